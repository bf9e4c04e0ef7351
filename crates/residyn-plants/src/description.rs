use serde::Deserialize;

use super::controlled::Unsuited;
use residyn_control::control::{Bounds, Task};
use residyn_core::data::Quantity;
use residyn_core::plant::check_step;

/// What a plant says of itself in its hello.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Description {
    pub name: String,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// How long a command is held, in s.
    pub step_s: f64,
    pub command: Commanded,
    pub clock: Clock,
    pub limits: Limits,
    /// The command that is safe to hold.
    pub safe: Vec<f64>,
    /// Names of further values in rows.
    #[serde(default)]
    pub measured: Vec<String>,
    /// Steps of silence after which a plant that moves by itself takes its safe command.
    #[serde(default = "usual_patience")]
    pub patience: usize,
    /// How many commands for the steps after it a step may carry.
    #[serde(default)]
    pub next: usize,
}

fn usual_patience() -> usize {
    5
}

/// What commands are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Commanded {
    /// In N m (or N).
    Torque,
    /// In rad (or m).
    Position,
}

impl Commanded {
    /// As logs call it.
    pub fn quantity(self) -> Quantity {
        match self {
            Self::Torque => Quantity::Torque,
            Self::Position => Quantity::Command,
        }
    }
}

/// Who waits for whom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// The plant moves only in a step.
    Simulated,
    /// The plant moves by itself.
    Wall,
}

/// What may be asked of a plant, one entry for each joint; `None` for a joint without such a limit.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Limits {
    /// Least and greatest command.
    pub command: Vec<[f64; 2]>,
    /// Fastest change of a command per second.
    #[serde(default)]
    pub rate: Option<Vec<Option<f64>>>,
    /// Greatest speed in rad/s (or m/s).
    #[serde(default)]
    pub speed: Option<Vec<Option<f64>>>,
    /// Least and greatest position in rad (or m).
    #[serde(default)]
    pub angle: Option<Vec<Option<[f64; 2]>>>,
    /// How far ahead of a limit of its angle a joint is braked, in s.
    #[serde(default = "usual_brake_s")]
    pub brake_s: f64,
}

fn usual_brake_s() -> f64 {
    0.1
}

impl Limits {
    /// Those of the state.
    fn bounds(&self) -> Bounds {
        Bounds {
            angle: self.angle.clone().unwrap_or_default(),
            speed: self.speed.clone().unwrap_or_default(),
            brake_s: self.brake_s,
        }
    }
}

impl Description {
    /// Keep the commands of a task within this plant's limits, and the states of its plans as far as they can be.
    ///
    /// # Errors
    /// Another step, or no command that both allow.
    pub fn bound(&self, task: &mut Task) -> Result<(), Unsuited> {
        if (task.step_s - self.step_s).abs() > 1e-9 * task.step_s {
            return Err(Unsuited::Step {
                task: task.name(),
                step_s: task.step_s,
                plant: self.name.clone(),
                of_plant_s: self.step_s,
            });
        }
        let name = task.name();
        let limits = task.torque.iter_mut().zip(&self.limits.command);
        for (joint, (planned, [low, high])) in (1..).zip(limits) {
            *planned = [planned[0].max(*low), planned[1].min(*high)];
            if !(planned[0] <= planned[1]) {
                return Err(Unsuited::Range {
                    task: name,
                    plant: self.name.clone(),
                    joint,
                    low: *low,
                    high: *high,
                });
            }
        }
        task.bounds = self.limits.bounds();
        Ok(())
    }

    /// What is wrong with it.
    pub fn fault(&self) -> Option<String> {
        let joints = self.joints.len();
        if joints == 0 {
            return Some("`joints` is empty; name each joint".into());
        }
        if let Err(fault) = check_step(self.step_s) {
            return Some(fault);
        }
        if self.patience == 0 {
            return Some("`patience` is 0; give at least one step".into());
        }
        let mut names = self.joints.iter().chain([&self.name]);
        if let Some(name) = names.find(|name| name.chars().any(char::is_control)) {
            return Some(format!("the name {name:?} is not for people"));
        }
        let is_plain = |name: &&String| name.chars().all(|c| c.is_alphanumeric() || c == '_');
        if let Some(name) = self.measured.iter().find(|name| !is_plain(name)) {
            return Some(format!(
                "`measured` names {name:?}; use letters, digits and underscores"
            ));
        }
        let Limits {
            command,
            rate,
            speed,
            angle,
            brake_s,
        } = &self.limits;
        let lengths = [
            ("safe", Some(self.safe.len())),
            ("limits.command", Some(command.len())),
            ("limits.rate", rate.as_ref().map(Vec::len)),
            ("limits.speed", speed.as_ref().map(Vec::len)),
            ("limits.angle", angle.as_ref().map(Vec::len)),
        ];
        let wrong = |(name, length): (&str, Option<usize>)| {
            let length = length.filter(|length| *length != joints)?;
            Some(format!("`{name}` has {length} entries for {joints} joints"))
        };
        if let Some(fault) = lengths.into_iter().find_map(wrong) {
            return Some(fault);
        }
        let known =
            |list: &Option<Vec<Option<f64>>>| list.iter().flatten().flatten().copied().collect();
        let positive: [(&str, Vec<f64>); 3] = [
            ("limits.rate", known(rate)),
            ("limits.speed", known(speed)),
            ("limits.brake_s", vec![*brake_s]),
        ];
        for (name, values) in positive {
            if let Some(value) = values.iter().find(|value| !(**value > 0.0)) {
                return Some(format!("`{name}` has {value}; give a number above zero"));
            }
        }
        let angles = angle.iter().flatten().flatten();
        let ranges = command.iter().map(|range| ("command", range, true));
        let mut ranges = ranges.chain(angles.map(|range| ("angle", range, false)));
        let empty = ranges
            .find(|(_, [low, high], may_be_point)| !(low < high || *may_be_point && low == high));
        if let Some((name, [low, high], _)) = empty {
            return Some(format!(
                "`limits.{name}` has [{low}, {high}]; give [least, greatest]"
            ));
        }
        let outside = |(safe, [low, high]): (&f64, &[f64; 2])| !(low <= safe && safe <= high);
        let mut safe = self.safe.iter().zip(command);
        (self.command == Commanded::Torque && safe.any(outside))
            .then(|| "`safe` is outside `limits.command`".into())
    }
}
