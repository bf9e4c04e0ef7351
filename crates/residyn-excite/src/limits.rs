//! What a rig may do: the limits file.

use std::path::Path;

use nalgebra::Vector3;
use serde::Deserialize;
use toml::Spanned;

use residyn_core::data::Joint;
use residyn_core::model::{FileError, Model};
use residyn_core::toml_text::from_toml;

/// Time between rows of a trajectory unless the file gives another one, s.
const STEP_S: f64 = 0.01;
/// Steps of a trajectory: ten minutes of a hundred rows a second are searched within the memory of a laptop.
const LEAST_STEPS: f64 = 10.0;
const MOST_STEPS: f64 = 60_000.0;
/// Noise of a torque unless the file gives one, as a share of the joint's largest torque.
const TORQUE_NOISE: f64 = 0.01;
/// Noise of an encoder unless the file gives one, rad (or m): a turn in about 2^14 steps.
const ENCODER_NOISE: f64 = 2e-4;

/// What a rig may do, checked against its model.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// Time between the rows of a trajectory, s.
    pub step_s: f64,
    /// One for each joint.
    pub joints: Vec<JointLimits>,
    /// Spheres around links that keep off each other and off the boxes.
    pub spheres: Vec<Sphere>,
    /// What the spheres keep off, in the axes of the base with z upwards.
    pub boxes: Vec<Cuboid>,
}

/// What one joint may do; in rad and N m, or m and N.
#[derive(Debug, Clone, PartialEq)]
pub struct JointLimits {
    /// Least and greatest angle.
    pub angle: [f64; 2],
    /// Largest speed, per s.
    pub speed: f64,
    /// Largest acceleration, per s^2.
    pub acceleration: f64,
    /// Largest torque.
    pub torque: Option<f64>,
    /// Largest change of the torque per s.
    pub torque_rate: Option<f64>,
    /// Least and greatest command of a drive, in its unit.
    pub command: Option<[f64; 2]>,
    /// Largest change of the command per s.
    pub command_rate: Option<f64>,
    /// Where the motion begins and ends; any angle if not given.
    pub start: Option<f64>,
    /// Standard deviation of the torque in each row.
    pub torque_noise: f64,
    /// Standard deviation of the angle in each row.
    pub encoder_noise: f64,
}

/// A sphere that moves with a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// The joint that moves it; `None` for one on the base.
    pub joint: Option<Joint>,
    /// In the frame of that joint (z is its axis), m.
    pub centre: Vector3<f64>,
    /// m
    pub radius: f64,
}

/// A box with edges along the axes of the base.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cuboid {
    /// m
    pub least: Vector3<f64>,
    /// m
    pub greatest: Vector3<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    step_s: Option<Spanned<f64>>,
    joint: Vec<Spanned<JointTable>>,
    #[serde(default)]
    sphere: Vec<SphereTable>,
    #[serde(default, rename = "box")]
    boxes: Vec<BoxTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JointTable {
    angle: Spanned<[f64; 2]>,
    speed: Spanned<f64>,
    acceleration: Spanned<f64>,
    torque: Option<Spanned<f64>>,
    torque_rate: Option<Spanned<f64>>,
    command: Option<Spanned<[f64; 2]>>,
    command_rate: Option<Spanned<f64>>,
    start: Option<Spanned<f64>>,
    torque_noise: Option<Spanned<f64>>,
    encoder_noise: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SphereTable {
    joint: Spanned<JointName>,
    centre: [f64; 3],
    radius: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum JointName {
    Number(usize),
    Name(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxTable {
    least: Spanned<[f64; 3]>,
    greatest: [f64; 3],
}

/// The text of a limits file, for messages.
struct Source<'t> {
    path: &'t Path,
    text: &'t str,
}

impl Limits {
    /// Read a limits file for this model; `path` is for messages.
    ///
    /// # Errors
    /// A text that is not a limits file, or does not suit the model: the line, and what to write instead.
    pub fn parse(text: &str, path: &Path, model: &Model) -> Result<Self, FileError> {
        let source = Source { path, text };
        let file: File = from_toml(text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start);
            source.at(at, error.message())
        })?;
        let joints = (file.joint.iter().enumerate())
            .map(|(k, table)| source.joint(model, k, table))
            .collect::<Result<Vec<_>, _>>()?;
        if joints.len() != model.joints {
            let at = file.joint.last().map_or(0, |last| last.span().start);
            let message = format!(
                "there are {} tables [[joint]], but `{}` has {} joints; write one for each, in their order",
                joints.len(),
                model.name,
                model.joints
            );
            return Err(source.at(at, message));
        }
        let spheres = (file.sphere.iter())
            .map(|table| source.sphere(model, table))
            .collect::<Result<_, _>>()?;
        let boxes = file.boxes.iter().map(|table| source.cuboid(table));
        Ok(Self {
            step_s: (file.step_s.as_ref())
                .map_or(Ok(STEP_S), |step_s| source.positive("step_s", step_s))?,
            joints,
            spheres,
            boxes: boxes.collect::<Result<_, _>>()?,
        })
    }

    /// Rows of a trajectory that lasts `duration_s`; `None` if these are too few or too many.
    pub fn rows(&self, duration_s: f64) -> Option<usize> {
        let steps = (duration_s / self.step_s).round();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // a whole number within bounds
        (LEAST_STEPS..=MOST_STEPS)
            .contains(&steps)
            .then_some(steps as usize + 1)
    }
}

impl Source<'_> {
    fn at(&self, at: usize, message: impl Into<String>) -> FileError {
        FileError::at(self.path, self.text, at, message)
    }

    fn positive(&self, name: &str, value: &Spanned<f64>) -> Result<f64, FileError> {
        let number = *value.get_ref();
        match number > 0.0 {
            true => Ok(number),
            false => {
                let message = format!("`{name}` is {number}; write a number above zero");
                Err(self.at(value.span().start, message))
            }
        }
    }

    fn range(&self, name: &str, value: &Spanned<[f64; 2]>) -> Result<[f64; 2], FileError> {
        let [low, high] = *value.get_ref();
        match low < high {
            true => Ok([low, high]),
            false => {
                let message = format!("`{name}` is [{low}, {high}]; write [least, greatest]");
                Err(self.at(value.span().start, message))
            }
        }
    }

    fn joint(
        &self,
        model: &Model,
        number: usize,
        table: &Spanned<JointTable>,
    ) -> Result<JointLimits, FileError> {
        let (at, table) = (table.span().start, table.get_ref());
        let optional = |name: &str, value: &Option<Spanned<f64>>| {
            (value.as_ref())
                .map(|value| self.positive(name, value))
                .transpose()
        };
        let angle = self.range("angle", &table.angle)?;
        let torque = optional("torque", &table.torque)?;
        let torque_noise = optional("torque_noise", &table.torque_noise)?;
        let torque_noise = torque_noise.or(torque.map(|torque| TORQUE_NOISE * torque));
        let torque_noise = torque_noise.ok_or_else(|| {
            let message = format!(
                "joint {} has neither `torque`, its largest torque, nor `torque_noise`; write one of them",
                number + 1
            );
            self.at(at, message)
        })?;
        for (name, value) in [
            ("command", table.command.as_ref().map(Spanned::span)),
            (
                "command_rate",
                table.command_rate.as_ref().map(Spanned::span),
            ),
        ] {
            if let (Some(span), true) = (value, model.drive_program().is_none()) {
                let message = format!(
                    "`{name}` limits a drive, but torques drive this model; write `torque`"
                );
                return Err(self.at(span.start, message));
            }
        }
        if let Some(start) = &table.start
            && !(angle[0] <= *start.get_ref() && *start.get_ref() <= angle[1])
        {
            let message = format!(
                "`start` is {}, outside of `angle`; write an angle from {} to {}",
                start.get_ref(),
                angle[0],
                angle[1]
            );
            return Err(self.at(start.span().start, message));
        }
        Ok(JointLimits {
            angle,
            speed: self.positive("speed", &table.speed)?,
            acceleration: self.positive("acceleration", &table.acceleration)?,
            torque,
            torque_rate: optional("torque_rate", &table.torque_rate)?,
            command: (table.command.as_ref())
                .map(|range| self.range("command", range))
                .transpose()?,
            command_rate: optional("command_rate", &table.command_rate)?,
            start: table.start.as_ref().map(|start| *start.get_ref()),
            torque_noise,
            encoder_noise: optional("encoder_noise", &table.encoder_noise)?
                .unwrap_or(ENCODER_NOISE),
        })
    }

    fn sphere(&self, model: &Model, table: &SphereTable) -> Result<Sphere, FileError> {
        let at = table.joint.span().start;
        if model.mechanism(&model.values()).is_none() {
            let message = "the model does not say where its links are; remove the spheres, or give a model with [chain]";
            return Err(self.at(at, message));
        }
        let joint = match table.joint.get_ref() {
            JointName::Number(0) => None,
            JointName::Number(number) => Joint::numbered(*number),
            JointName::Name(name) => {
                let place = model.joint_names.iter().position(|own| own == name);
                let known = model.joint_names.join(", ");
                let unknown = || {
                    let message =
                        format!("no joint is called `{name}`; write one of {known}, or a number");
                    self.at(at, message)
                };
                Some(Joint::at(place.ok_or_else(unknown)?))
            }
        };
        if joint.is_some_and(|joint| !joint.is_of(model.joints)) {
            let message = format!(
                "write a joint from 1 to {}, or 0 for the base",
                model.joints
            );
            return Err(self.at(at, message));
        }
        Ok(Sphere {
            joint,
            centre: Vector3::from(table.centre),
            radius: self.positive("radius", &table.radius)?,
        })
    }

    fn cuboid(&self, table: &BoxTable) -> Result<Cuboid, FileError> {
        let (least, greatest) = (*table.least.get_ref(), table.greatest);
        match least.iter().zip(&greatest).all(|(low, high)| low < high) {
            true => Ok(Cuboid {
                least: Vector3::from(least),
                greatest: Vector3::from(greatest),
            }),
            false => {
                let message = format!(
                    "`least` is {least:?} and `greatest` {greatest:?}; each number of `least` must be below the other"
                );
                Err(self.at(table.least.span().start, message))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use residyn_core::model::Library;

    use super::Limits;

    fn parse(system: &str, text: &str) -> Result<Limits, String> {
        let model = Library::built_in().model(system).unwrap();
        Limits::parse(text, Path::new("limits.toml"), &model).map_err(|error| error.to_string())
    }

    const JOINT: &str =
        "[[joint]]\nangle = [-1.0, 1.0]\nspeed = 2.0\nacceleration = 9.0\ntorque = 5.0\n";

    #[test]
    fn noise_follows_from_the_largest_torque() {
        let limits = parse("pendulum", JOINT).unwrap();
        assert_eq!(limits.step_s, 0.01);
        assert!((limits.joints[0].torque_noise - 0.05).abs() < 1e-15);
        assert_eq!(limits.joints[0].start, None);
    }

    #[test]
    fn faults_name_their_line_and_a_remedy() {
        for (system, text, expected) in [
            (
                "pendulum",
                format!("{JOINT}start = 3.0"),
                "line 6, column 9: `start` is 3, outside",
            ),
            (
                "pendulum",
                JOINT.replace("[-1.0, 1.0]", "[1.0, -1.0]"),
                "line 2, column 9: `angle` is [1, -1]; write [least, greatest]",
            ),
            (
                "pendulum",
                JOINT.replace("2.0", "0.0"),
                "line 3, column 9: `speed` is 0; write a number above zero",
            ),
            (
                "pendulum",
                JOINT.replace("torque = 5.0", ""),
                "line 1, column 1: joint 1 has neither `torque`",
            ),
            (
                "pendulum",
                format!("{JOINT}speeed = 3.0"),
                "unknown field `speeed`",
            ),
            (
                "pendulum",
                format!("{JOINT}command = [0.0, 1.0]"),
                "line 6, column 11: `command` limits a drive",
            ),
            (
                "pendulum",
                JOINT.replace("9.0", "nan"),
                "nan is not a finite number",
            ),
            (
                "acrobot",
                JOINT.to_owned(),
                "there are 1 tables [[joint]], but `acrobot` has 2 joints",
            ),
            (
                "pendulum",
                format!("{JOINT}[[sphere]]\njoint = 1\ncentre = [0, 0, 0]\nradius = 0.1\n"),
                "does not say where its links are",
            ),
            (
                "pendulum",
                format!("{JOINT}[[box]]\nleast = [0, 0, 1]\ngreatest = [1, 1, 0]\n"),
                "line 7, column 9: `least` is",
            ),
        ] {
            let message = parse(system, &text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
