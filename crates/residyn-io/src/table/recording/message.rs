//! Messages with joint data, decoded to named numbers.

use re_cdr::{BigEndian, LittleEndian, from_bytes};
use serde::Deserialize;
use serde::de::DeserializeOwned;

/// The numbers of a message: `elbow/position` for joint states, `1`, `2` .. for an array.
#[derive(Debug)]
pub(super) struct Message {
    /// \[ns\]; 0 if the message has none.
    pub stamp_ns: i64,
    pub names: Vec<String>,
    pub values: Vec<f64>,
}

/// Suffixes of joint names, and the stems of the standard names.
pub(super) const CHANNELS: [(&str, &str); 3] =
    [("/position", "q"), ("/velocity", "qd"), ("/effort", "tau")];

pub(super) type Decoder = fn(&[u8]) -> Result<Message, String>;

/// The decoder for messages of a type, such as `sensor_msgs/msg/JointState`; `None` for types that are not read.
pub(super) fn decoder(kind: &str, encoding: &str) -> Option<Decoder> {
    let name = kind.rsplit(['/', '.']).next().unwrap_or(kind);
    match (name, encoding) {
        ("JointState", "cdr") => Some(cdr::<JointState>),
        ("JointState", "json") => Some(json::<JointState>),
        ("JointStates", "json") => Some(json::<JointStates>),
        ("Float64MultiArray", "cdr") => Some(cdr::<Float64MultiArray>),
        ("Float64MultiArray", "json") => Some(json::<Float64MultiArray>),
        ("Float64", "cdr") => Some(cdr::<Float64>),
        ("Float64", "json") => Some(json::<Float64>),
        _ => None,
    }
}

fn cdr<T: DeserializeOwned + Numbers>(data: &[u8]) -> Result<Message, String> {
    let (encapsulation, body) = data.split_at_checked(4).unwrap_or_default();
    let decoded = match encapsulation {
        [0, 0, ..] => from_bytes::<T, BigEndian>(body),
        [0, 1, ..] => from_bytes::<T, LittleEndian>(body),
        _ => return Err("does not begin with a CDR header".to_owned()),
    };
    let (message, _) = decoded.map_err(|why| why.to_string())?;
    message.numbers()
}

fn json<T: DeserializeOwned + Numbers>(data: &[u8]) -> Result<Message, String> {
    let message: T = serde_json::from_slice(data).map_err(|why| why.to_string())?;
    message.numbers()
}

trait Numbers {
    fn numbers(self) -> Result<Message, String>;
}

/// `builtin_interfaces/msg/Time`, with the names that JSON writers give to its parts.
#[derive(Debug, Default, Deserialize)]
struct Stamp {
    #[serde(alias = "secs")]
    sec: i32,
    #[serde(alias = "nsec", alias = "nsecs")]
    nanosec: u32,
}

impl Stamp {
    fn ns(&self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }
}

/// `std_msgs/msg/Header`
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Header {
    stamp: Stamp,
    frame_id: String,
}

/// `sensor_msgs/msg/JointState`
#[derive(Debug, Deserialize)]
struct JointState {
    #[serde(default)]
    header: Header,
    name: Vec<String>,
    #[serde(default)]
    position: Vec<f64>,
    #[serde(default)]
    velocity: Vec<f64>,
    #[serde(default)]
    effort: Vec<f64>,
}

impl Numbers for JointState {
    /// An array is empty if the driver does not report that quantity.
    fn numbers(self) -> Result<Message, String> {
        let arrays = [self.position, self.velocity, self.effort];
        let (mut names, mut values) = (Vec::new(), Vec::new());
        for ((suffix, _), array) in CHANNELS.into_iter().zip(arrays) {
            if !array.is_empty() && array.len() != self.name.len() {
                let (found, joints) = (array.len(), self.name.len());
                return Err(format!(
                    "has {found} of `{}` for {joints} joint(s)",
                    &suffix[1..]
                ));
            }
            let joints = self.name.iter().zip(&array);
            names.extend(joints.map(|(joint, _)| format!("{joint}{suffix}")));
            values.extend(array);
        }
        Ok(Message {
            stamp_ns: self.header.stamp.ns(),
            names,
            values,
        })
    }
}

/// `foxglove.JointStates`
#[derive(Debug, Deserialize)]
struct JointStates {
    #[serde(default)]
    timestamp: Stamp,
    joints: Vec<Joint>,
}

/// `foxglove.JointState`
#[derive(Debug, Deserialize)]
struct Joint {
    name: String,
    position: Option<f64>,
    velocity: Option<f64>,
    effort: Option<f64>,
}

impl Numbers for JointStates {
    fn numbers(self) -> Result<Message, String> {
        let of_joint = |joint: &Joint| {
            let values = [joint.position, joint.velocity, joint.effort];
            let channels = CHANNELS.into_iter().zip(values);
            let named = channels.filter_map(|((suffix, _), value)| {
                Some((format!("{}{suffix}", joint.name), value?))
            });
            named.collect::<Vec<_>>()
        };
        let (names, values) = self.joints.iter().flat_map(of_joint).unzip();
        Ok(Message {
            stamp_ns: self.timestamp.ns(),
            names,
            values,
        })
    }
}

/// `std_msgs/msg/Float64MultiArray`
#[derive(Debug, Deserialize)]
struct Float64MultiArray {
    #[expect(dead_code, reason = "CDR has to pass it")]
    #[serde(default)]
    layout: Layout,
    data: Vec<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[expect(dead_code, reason = "CDR has to pass it")]
struct Layout {
    dim: Vec<Dimension>,
    data_offset: u32,
}

#[derive(Debug, Deserialize)]
#[expect(dead_code, reason = "CDR has to pass it")]
struct Dimension {
    label: String,
    size: u32,
    stride: u32,
}

impl Numbers for Float64MultiArray {
    fn numbers(self) -> Result<Message, String> {
        Ok(Message {
            stamp_ns: 0,
            names: (1..=self.data.len()).map(|k| k.to_string()).collect(),
            values: self.data,
        })
    }
}

/// `std_msgs/msg/Float64`
#[derive(Debug, Deserialize)]
struct Float64 {
    data: f64,
}

impl Numbers for Float64 {
    fn numbers(self) -> Result<Message, String> {
        Ok(Message {
            stamp_ns: 0,
            names: vec!["data".to_owned()],
            values: vec![self.data],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As a publisher writes it: `words` of 4 bytes, then numbers.
    fn encoded(words: &[u32], numbers: &[f64]) -> Vec<u8> {
        let words = words.iter().flat_map(|word| word.to_le_bytes());
        let numbers = numbers.iter().flat_map(|number| number.to_le_bytes());
        [0, 1, 0, 0]
            .into_iter()
            .chain(words)
            .chain(numbers)
            .collect()
    }

    #[test]
    fn arrays_are_padded_to_their_numbers() {
        let read = decoder("std_msgs/msg/Float64MultiArray", "cdr").unwrap();
        // No dimensions, no offset, two numbers, and four bytes that align them.
        let message = read(&encoded(&[0, 0, 2, 0], &[1.5, -2.0])).unwrap();
        assert_eq!(
            (message.names, message.values),
            (vec!["1".to_owned(), "2".to_owned()], vec![1.5, -2.0])
        );
        // More numbers are announced than there are.
        assert!(read(&encoded(&[0, 0, 3, 0], &[1.5, -2.0])).is_err());
        assert!(read(&encoded(&[0, 0, u32::MAX, 0], &[1.5])).is_err());
        assert_eq!(
            read(&[0, 7, 0, 0]).unwrap_err(),
            "does not begin with a CDR header"
        );
    }

    #[test]
    fn json_is_read_as_ros_and_as_foxglove_write_it() {
        let ros = decoder("sensor_msgs/JointState", "json").unwrap();
        let message = ros(
            br#"{"header": {"seq": 1, "stamp": {"sec": 2, "nsec": 5}}, "name": ["a"], "position": [1], "effort": [3]}"#,
        );
        let message = message.unwrap();
        assert_eq!(
            (message.stamp_ns, message.values),
            (2_000_000_005, vec![1.0, 3.0])
        );
        assert_eq!(message.names, ["a/position", "a/effort"]);
        let foxglove = decoder("foxglove.JointStates", "json").unwrap();
        let message = foxglove(br#"{"joints": [{"name": "a", "position": 1, "velocity": 2}]}"#);
        assert_eq!(message.unwrap().names, ["a/position", "a/velocity"]);
        let short = ros(br#"{"name": ["a", "b"], "position": [1]}"#);
        assert_eq!(short.unwrap_err(), "has 1 of `position` for 2 joint(s)");
    }

    #[test]
    fn other_types_and_encodings_are_not_read() {
        assert!(decoder("sensor_msgs/msg/Image", "cdr").is_none());
        assert!(decoder("sensor_msgs/JointState", "ros1").is_none());
    }
}
