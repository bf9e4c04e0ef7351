use std::borrow::Cow;
use std::fmt;
use std::ops::{Index, IndexMut};
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer, Error};
use serde::ser::{Serialize, Serializer};
use thiserror::Error as ThisError;

/// One joint of a rig.
///
/// Lists with one entry per joint are indexed by it, from 0. Users see its number, from 1: that is what it prints, what
/// files hold and what is read from them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Joint(usize);

impl Joint {
    /// The joint at this place of a list with one entry per joint.
    pub const fn at(index: usize) -> Self {
        Self(index)
    }

    /// The joint with this number, from 1; `None` for 0.
    pub fn numbered(number: usize) -> Option<Self> {
        number.checked_sub(1).map(Self)
    }

    /// The joints of a rig that has `count` of them, in order.
    pub fn all(count: usize) -> impl DoubleEndedIterator<Item = Self> + ExactSizeIterator + Clone {
        (0..count).map(Self)
    }

    /// Whether a rig with `count` joints has it.
    pub const fn is_of(self, count: usize) -> bool {
        self.0 < count
    }

    /// Its place in a list with one entry per joint.
    pub const fn index(self) -> usize {
        self.0
    }

    /// The joint after it.
    #[must_use]
    pub const fn next(self) -> Self {
        Self(self.0 + 1)
    }

    /// Its number, from 1.
    pub const fn number(self) -> usize {
        self.0 + 1
    }

    /// Its label for users: its number, with its name if it has one.
    pub fn called(self, name: Option<&str>) -> String {
        name.map_or_else(|| self.to_string(), |name| format!("{self} ({name})"))
    }

    /// A variable of this joint: `q2` for `q`.
    pub fn name(self, stem: &str) -> String {
        format!("{stem}{self}")
    }
}

/// The entries of a list that belong to these joints; none of an empty list.
pub(crate) fn of_joints<T: Clone>(all: &[T], joints: &[Joint]) -> Vec<T> {
    let own = joints.iter().filter_map(|joint| all.get(joint.index()));
    own.cloned().collect()
}

impl fmt::Display for Joint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.number().fmt(f)
    }
}

/// A text that is not the number of a joint.
#[derive(Debug, Clone, PartialEq, Eq, ThisError)]
#[error("{0:?} is not a joint number; joints count from 1")]
pub struct JointError(String);

impl FromStr for Joint {
    type Err = JointError;

    fn from_str(text: &str) -> Result<Self, JointError> {
        let number = text.parse().ok().and_then(Self::numbered);
        number.ok_or_else(|| JointError(text.to_owned()))
    }
}

impl Serialize for Joint {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.number().serialize(serializer)
    }
}

impl JsonSchema for Joint {
    fn schema_name() -> Cow<'static, str> {
        "Joint".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": "integer", "minimum": 1})
    }
}

impl<'de> Deserialize<'de> for Joint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let number = usize::deserialize(deserializer)?;
        Self::numbered(number).ok_or_else(|| Error::custom("joints are counted from 1, found 0"))
    }
}

impl<T> Index<Joint> for [T] {
    type Output = T;

    fn index(&self, joint: Joint) -> &T {
        &self[joint.0]
    }
}

impl<T> IndexMut<Joint> for [T] {
    fn index_mut(&mut self, joint: Joint) -> &mut T {
        &mut self[joint.0]
    }
}

impl<T> Index<Joint> for Vec<T> {
    type Output = T;

    fn index(&self, joint: Joint) -> &T {
        &self[joint.0]
    }
}

impl<T> IndexMut<Joint> for Vec<T> {
    fn index_mut(&mut self, joint: Joint) -> &mut T {
        &mut self[joint.0]
    }
}

#[cfg(test)]
mod tests {
    use super::Joint;

    #[test]
    fn a_joint_is_written_from_1_and_indexes_from_0() {
        let second = Joint::at(1);
        assert_eq!(second.to_string(), "2");
        assert_eq!(second.name("qd"), "qd2");
        assert_eq!(serde_json::to_string(&second).unwrap(), "2");
        assert_eq!(serde_json::from_str::<Joint>("2").unwrap(), second);
        assert_eq!("2".parse(), Ok(second));
        assert_eq!(["a", "b"][second], "b");
        assert_eq!(vec![10, 20][second], 20);
    }

    #[test]
    fn there_is_no_joint_0() {
        assert!(serde_json::from_str::<Joint>("0").is_err());
        assert!("0".parse::<Joint>().is_err());
        assert_eq!(Joint::numbered(0), None);
    }
}
