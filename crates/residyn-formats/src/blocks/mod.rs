//! The actuators of a model as settings of simulators that learn: Python with one block a joint. Bodies are not in it:
//! these simulators read a robot description.

pub(super) mod isaaclab;
pub(super) mod mjlab;

use std::fmt::Write;
use std::path::Path;

use super::robot::powertrain::{PositionLoop, Powertrain, Powertrains};
use super::{ExportModel, File};
use residyn_core::data::Joint;
use residyn_core::model::tree::rounded;

/// Why nothing is predicted from the written files.
const NO_CLIENT: &str = "the file holds settings of actuators, not a model";

/// A joint on a position loop.
struct Block {
    /// Its name in the robot description.
    name: String,
    held: PositionLoop,
    /// N m or N
    effort: Option<f64>,
    /// kg m^2 or kg
    armature: f64,
    /// N m or N
    dry_friction: f64,
    /// N m s/rad, or N s/m
    viscous_friction: f64,
    /// In s; zero without a delay.
    delay_s: f64,
}

/// The blocks of a model, and what they do not hold.
struct Blocks {
    blocks: Vec<Block>,
    not_carried: Vec<String>,
}

impl Blocks {
    /// The blocks of a model.
    ///
    /// # Errors
    /// Drives that are no position loops, or of no known form.
    fn of(model: &ExportModel) -> Result<Self, String> {
        let Powertrains {
            joints,
            mut not_carried,
        } = Powertrains::of(model)?;
        let numbered = || Joint::all(model.joints()).zip(&joints);
        let block = |(joint, powertrain): (Joint, &Powertrain)| {
            Block::of(model, joint, powertrain).ok_or_else(|| {
                format!(
                    "joint {} is not held at a position: the torque of its drive is not kp*(cmd - q) - kd*qd up to a limit",
                    model.system.joint_label(joint)
                )
            })
        };
        let blocks = numbered().map(block).collect::<Result<_, _>>()?;
        for (joint, powertrain) in numbered() {
            let label = model.system.joint_label(joint);
            let others = beyond_a_block(powertrain).into_iter();
            not_carried.extend(others.map(|what| format!("{what} on joint {label}")));
        }
        not_carried.push("the bodies: masses and inertias belong in the robot description".into());
        Ok(Self {
            blocks,
            not_carried,
        })
    }

    /// What the blocks of a model do not hold; nothing of one that has none.
    fn not_carried(model: &ExportModel) -> Vec<String> {
        Self::of(model).map_or_else(|_| Vec::new(), |own| own.not_carried)
    }

    /// The first lines of a file: `about`, the origin of the numbers, what is missing, imports, and the physics step.
    fn head(&self, model: &ExportModel, about: &str, imports: &str) -> String {
        let mut text = format!("# {about}\n# {}\n#\n", model.provenance());
        for what in &self.not_carried {
            let _ = writeln!(text, "# not carried: {}", what.replace('\n', " "));
        }
        let _ = write!(
            text,
            "\n{imports}\n\n# The physics step in s: delays are rounded to whole steps.\nSTEP_S = {}\n\n\n\
             def steps(delay_s):\n    return round(delay_s / STEP_S)\n\n\n",
            number(model.step_s)
        );
        text
    }

    /// The one file: its head, and each block as `written` between these brackets.
    fn file(
        &self,
        path: &Path,
        head: String,
        [open, close]: [&str; 2],
        written: fn(&Block) -> String,
    ) -> Vec<File> {
        let blocks: String = self.blocks.iter().map(written).collect();
        let text = format!("{head}ACTUATORS = {open}\n{blocks}{close}\n");
        vec![File::new(path, text, "ACTUATORS, one a joint")]
    }
}

impl Block {
    fn of(model: &ExportModel, joint: Joint, powertrain: &Powertrain) -> Option<Self> {
        let Powertrain {
            joint: own, drive, ..
        } = powertrain;
        let name = model.system.joint_names.get(joint.index());
        Some(Self {
            name: name.cloned().unwrap_or_else(|| joint.name("joint")),
            held: drive.position_loop()?,
            effort: drive.effort(),
            armature: own.armature,
            dry_friction: own.friction,
            viscous_friction: own.damping,
            delay_s: drive.delay.unwrap_or(0.0),
        })
    }

    /// The name as a Python string.
    fn key(&self) -> String {
        quoted(&self.name)
    }

    /// A regular expression that this name alone matches, as a Python string.
    fn pattern(&self) -> String {
        let escape = |letter: char| match r".^$*+?{}[]\|()".contains(letter) {
            true => format!("\\{letter}"),
            false => letter.to_string(),
        };
        quoted(&self.name.chars().map(escape).collect::<String>())
    }
}

/// What of a powertrain no block holds.
fn beyond_a_block(powertrain: &Powertrain) -> Vec<String> {
    let Powertrain { joint, zero, drive } = powertrain;
    let constant = drive.bias[0];
    let parts = [
        (constant != 0.0).then(|| format!("a constant torque of {}", number(constant))),
        drive.lag.map(|time| format!("a lag of {} s", number(time))),
        joint.spring.map(|spring| {
            let [stiffness, rest] = [spring.stiffness, spring.rest].map(number);
            format!("a spring of {stiffness} with rest at {rest}")
        }),
        (*zero != 0.0).then(|| format!("a zero that is off by {}", number(*zero))),
    ];
    parts.into_iter().flatten().collect()
}

fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// To 15 digits, as a Python float.
fn number(value: f64) -> String {
    format!("{:?}", rounded(value))
}
