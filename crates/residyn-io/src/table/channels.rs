//! Arrays with one column for each joint, under the names that simulators, recorders and data sets give them.

use std::io::Read;

use residyn_core::limits::LOG_COLUMNS;

use super::arrays::Unpacked;
use super::npy::Array;

/// Names of arrays with a column for each joint, and the stems of the standard names; of several for one stem, the first
/// is read.
const CHANNELS: [(&str, &str); 19] = [
    ("q", "q"),
    ("qd", "qd"),
    ("cmd", "cmd"),
    ("tau", "tau"),
    ("dof_pos", "q"),
    ("joint_pos", "q"),
    ("qpos", "q"),
    ("dof_vel", "qd"),
    ("joint_vel", "qd"),
    ("qvel", "qd"),
    ("des_dof_pos", "cmd"),
    ("dof_pos_target", "cmd"),
    ("joint_pos_target", "cmd"),
    ("targets", "cmd"),
    ("action", "cmd"),
    ("torques", "tau"),
    ("dof_torque", "tau"),
    ("actual_torque", "tau"),
    ("effort", "tau"),
];

/// Names of the list that names the joints, in the order of their columns.
pub(super) const JOINTS: [&str; 3] = ["joint_names", "dof_names", "joint_order"];

/// Whether this is the name of a channel: the time, or one with a column for each joint.
pub(super) fn is_channel(name: &str) -> bool {
    name == "time" || CHANNELS.iter().any(|(known, _)| *known == name)
}

/// How the arrays of one file become columns.
pub(super) struct Channels {
    /// Of all arrays.
    pub names: Vec<String>,
    /// Names of the joints; none if the file gives none.
    pub joints: Vec<String>,
}

impl Channels {
    /// Whether an array of this shape is read.
    ///
    /// # Errors
    /// A channel that has not one row per sample, and one column per joint.
    pub fn takes(&self, name: &str, shape: &[usize]) -> Result<bool, String> {
        let columns = shape.get(1).copied().unwrap_or(1);
        let is_table = (1..=2).contains(&shape.len());
        if !is_channel(name) {
            return Ok(shape.len() <= 2 && columns <= LOG_COLUMNS);
        }
        if !is_table {
            return Err(format!(
                "array {name:?} has the shape {shape:?}; save one row per sample, and one column per joint"
            ));
        }
        let joints = self.joints.len();
        if self.stem(name).is_some() && joints > 0 && joints != columns {
            return Err(format!(
                "array {name:?} has {columns} columns, and {joints} joints have names; save as many of both"
            ));
        }
        Ok(true)
    }

    /// The columns of an array: of a joint each if it is a channel, as those of any array otherwise.
    ///
    /// # Errors
    /// As [`Unpacked::add_as`].
    pub fn add(
        &self,
        unpacked: &mut Unpacked,
        name: &str,
        array: Array<impl Read>,
    ) -> Result<(), String> {
        if let Some(stem) = name.strip_suffix("_time").and_then(|of| self.stem(of)) {
            return unpacked.add(&format!("{stem}_time"), array);
        }
        match self.stem(name) {
            Some(stem) if !self.joints.is_empty() => unpacked.add_as(name, array, |column| {
                format!("{stem}_{}", self.joints[column])
            }),
            stem => unpacked.add(stem.unwrap_or(name), array),
        }
    }

    /// A note on channels whose joints are not known by name.
    pub fn note(&self) -> Option<String> {
        let is_by_joint = self.names.iter().any(|name| self.stem(name).is_some());
        (is_by_joint && self.joints.is_empty()).then(|| {
            "names no joints: the columns of its arrays are taken in the order of the model's joints".to_owned()
        })
    }

    /// The stem of an array's columns, if it is the file's for that stem.
    fn stem(&self, name: &str) -> Option<&'static str> {
        let (_, stem) = CHANNELS.iter().find(|(known, _)| *known == name)?;
        let mut of_stem = CHANNELS.iter().filter(|(_, other)| other == stem);
        let first = of_stem.find(|(known, _)| self.names.iter().any(|name| name == known))?;
        (first.0 == name).then_some(stem)
    }
}
