//! The actuator of a joint on a position loop, as simulators know it.

use super::quantity::{Number, Quantity};
use super::{number, quoted};
use crate::ExportModel;
use crate::robot::powertrain::{Powertrain, Powertrains};
use residyn_core::data::Joint;

/// A joint on a position loop.
pub(super) struct Block {
    /// Its name in the robot description.
    pub name: String,
    /// Its number and name, for messages.
    pub label: String,
    numbers: [Option<Number>; Quantity::ALL.len()],
}

/// The blocks of a model, and what they do not hold.
pub(super) struct Blocks {
    pub blocks: Vec<Block>,
    pub not_carried: Vec<String>,
}

impl Blocks {
    /// The blocks of a model.
    ///
    /// # Errors
    /// Drives that are no position loops, or of no known form.
    pub fn of(model: &ExportModel) -> Result<Self, String> {
        let Powertrains {
            joints,
            mut not_carried,
        } = Powertrains::of(model)?;
        let at_ends = Powertrains::at_ends(model);
        let numbered = || Joint::all(model.joints()).zip(&joints);
        let block = |(joint, powertrain): (Joint, &Powertrain)| {
            let ends = at_ends.iter();
            let ends: Vec<_> = ends
                .map(|ends| ends.each_ref().map(|all| &all[joint.index()]))
                .collect();
            Block::of(model, joint, powertrain, &ends).ok_or_else(|| {
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
}

impl Block {
    /// The block of a joint, with its powertrain as one parameter after the other is at the ends of its interval.
    fn of(
        model: &ExportModel,
        joint: Joint,
        powertrain: &Powertrain,
        at_ends: &[[&Powertrain; 2]],
    ) -> Option<Self> {
        powertrain.drive.position_loop()?;
        let name = model.system.joint_names.get(joint.index());
        Some(Self {
            name: name.cloned().unwrap_or_else(|| joint.name("joint")),
            label: model.system.joint_label(joint),
            numbers: Quantity::ALL.map(|own| own.number(powertrain, at_ends)),
        })
    }

    pub fn number(&self, own: Quantity) -> Option<Number> {
        self.numbers[own as usize]
    }

    /// The interval of a number that is not zero.
    pub fn range(&self, own: Quantity) -> Option<[f64; 2]> {
        self.number(own)?.range
    }

    pub fn is_late(&self) -> bool {
        self.number(Quantity::Delay)
            .is_some_and(|delay| delay.value > 0.0)
    }

    /// The shortest and the longest delay in steps, as Python.
    pub fn delay(&self) -> Option<[String; 2]> {
        let Number { value, range } = self.number(Quantity::Delay)?;
        let ends = range.unwrap_or([value; 2]);
        Some(ends.map(|end| format!("steps({})", number(end)))).filter(|_| self.is_late())
    }

    /// Those of these fields that the joint has, as Python.
    pub fn fields(&self, names: &[(&'static str, Quantity)]) -> Vec<(&'static str, String)> {
        let field = |(name, own): &(&'static str, Quantity)| {
            Some((*name, number(self.number(*own)?.value)))
        };
        names.iter().filter_map(field).collect()
    }

    /// The name as a Python string.
    pub fn key(&self) -> String {
        quoted(&self.name)
    }

    /// A regular expression that this name alone matches, as a Python string.
    pub fn pattern(&self) -> String {
        let escape = |letter: char| match r".^$*+?{}[]\|()".contains(letter) {
            true => format!("\\{letter}"),
            false => letter.to_string(),
        };
        quoted(&self.name.chars().map(escape).collect::<String>())
    }
}

/// What of a powertrain no block holds.
fn beyond_a_block(powertrain: &Powertrain) -> Vec<String> {
    let Powertrain {
        joint,
        zero,
        drive,
        motor,
    } = powertrain;
    let constant = drive.bias[0];
    let parts = [
        (constant != 0.0).then(|| format!("a constant torque of {}", number(constant))),
        drive.lag.map(|time| format!("a lag of {} s", number(time))),
        joint.spring.map(|spring| {
            let [stiffness, rest] = [spring.stiffness, spring.rest].map(number);
            format!("a spring of {stiffness} with rest at {rest}")
        }),
        (*zero != 0.0).then(|| format!("a zero that is off by {}", number(*zero))),
        motor.as_ref().map(|motor| motor.said.clone()),
    ];
    parts.into_iter().flatten().collect()
}
