//! The messages of docs/plants.md, version 1.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::description::Description;

/// The version of the protocol.
pub const PROTOCOL: u32 = 1;

/// Most bytes of a line, with its end.
pub const LONGEST_LINE: usize = 1_000_000;

/// What the host says.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum ToPlant<'a> {
    Hello {
        protocol: u32,
        program: &'a str,
    },
    Reset {
        seed: u64,
        #[serde(skip_serializing_if = "Option::is_none")]
        start: Option<&'a [f64]>,
    },
    Step {
        id: u64,
        command: &'a [f64],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        next: &'a [Vec<f64>],
    },
    Stop,
}

/// What a plant says. Unknown fields are ignored.
#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum FromPlant {
    Hello(Box<Hello>),
    Rows { rows: Vec<Row> },
    Stopped,
    Error { message: String },
}

/// What a plant says of itself.
#[derive(Debug, Deserialize)]
pub struct Hello {
    pub protocol: u32,
    #[serde(flatten)]
    pub description: Description,
}

/// What is measured at one moment.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Row {
    /// s since the reset by the plant's clock.
    pub time: f64,
    /// Positions in rad (or m).
    pub q: Vec<f64>,
    /// Velocities in rad/s (or m/s), if they are measured.
    #[serde(default)]
    pub qd: Option<Vec<f64>>,
    /// Torques in N m (or N) that acted up to the row, if they are known.
    #[serde(default)]
    pub tau: Option<Vec<f64>>,
    /// Id of the command that acted up to the row; 0 for the safe command.
    #[serde(default)]
    pub command: u64,
    /// How many of that command's next ones were applied: the last of them acted up to the row, or the command itself.
    #[serde(default)]
    pub ahead: usize,
    /// Further values by name.
    #[serde(default)]
    pub measured: BTreeMap<String, f64>,
}

impl Row {
    /// What is wrong with the row of a plant with so many joints, after a row at `after_s`.
    pub fn fault(&self, joints: usize, after_s: Option<f64>) -> Option<String> {
        let lists = [
            ("q", Some(&self.q)),
            ("qd", self.qd.as_ref()),
            ("tau", self.tau.as_ref()),
        ];
        for (name, list) in lists {
            let Some(list) = list else { continue };
            if list.len() != joints {
                return Some(format!(
                    "`{name}` has {} numbers for {joints} joints",
                    list.len()
                ));
            }
        }
        let lists = lists.iter().filter_map(|(_, list)| *list).flatten();
        let measured = self.measured.values();
        let mut all = lists.chain(measured).chain([&self.time]);
        if let Some(value) = all.find(|value| !residyn_core::limits::is_reading(**value)) {
            return Some(format!("{value} is not a reading"));
        }
        let after_s = after_s.filter(|after_s| self.time <= *after_s)?;
        Some(format!(
            "a row at {} s comes after one at {after_s} s: times increase",
            self.time
        ))
    }
}
