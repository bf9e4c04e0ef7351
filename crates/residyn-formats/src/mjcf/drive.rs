//! Writes the drives of joints as actuators.

use std::fmt::Write;

use super::write::attributes;
use crate::ExportModel;
use crate::robot::mechanism::{Mechanism, mujoco_step_s, numbers};
use crate::robot::powertrain::{Drive, PositionLoop};
use residyn_core::sim::SEMI_IMPLICIT_EULER;

/// The actuators of a mechanism, one a joint.
pub(super) fn actuators(model: &ExportModel, mechanism: &Mechanism) -> String {
    let clock = Clock::of(model);
    let joints = mechanism.joints.iter().zip(&mechanism.drives);
    let elements = joints.map(|(joint, drive)| actuator(&joint.name, drive, &clock));
    let elements: String = elements.collect();
    let is_late = mechanism.drives.iter().any(|drive| drive.delay.is_some());
    let note = if is_late { clock.note() } else { String::new() };
    format!("  <actuator>\n{note}{elements}  </actuator>\n")
}

/// What of the drives' timing MuJoCo does otherwise.
pub(super) fn timing_not_carried(model: &ExportModel, mechanism: &Mechanism) -> Vec<String> {
    let clock = Clock::of(model);
    let delays = || mechanism.drives.iter().filter_map(|drive| drive.delay);
    let mut lost = Vec::new();
    if mechanism.drives.iter().any(|drive| drive.lag.is_some()) {
        lost.push(
            "the lag within a step: MuJoCo holds the lagged torque over each step; only the derivative is compared"
                .to_owned(),
        );
    }
    if delays().any(|delay| delay < clock.step_s) {
        lost.push(format!(
            "delays shorter than a step of {} s: MuJoCo delays by a step at least; export with a shorter one",
            clock.step_s
        ));
    }
    if clock.reads_within_steps && delays().next().is_some() {
        lost.push(
            "commands that jump within a step: with RK4 MuJoCo draws a line between delayed commands".to_owned(),
        );
    }
    lost
}

/// The times at which MuJoCo reads delayed commands.
struct Clock {
    /// MuJoCo's step, in s.
    step_s: f64,
    /// Whether stages of the integrator read them, rather than the beginning of the step alone.
    reads_within_steps: bool,
}

impl Clock {
    fn of(model: &ExportModel) -> Self {
        Self {
            step_s: mujoco_step_s(model),
            reads_within_steps: model.integrator.scheme() != SEMI_IMPLICIT_EULER,
        }
    }

    /// A command that is held over a step and reaches the drive within another is, on average over that step, the line
    /// between the two commands at its beginning: MuJoCo's linear interpolation. Stages are on average half a step later.
    fn delay(&self, delay_s: f64) -> f64 {
        match self.reads_within_steps {
            true => delay_s + 0.5 * self.step_s,
            false => delay_s,
        }
    }

    /// Commands that MuJoCo has to remember: those of the delay, and one more if its length is rounded.
    fn samples(&self, delay_s: f64) -> f64 {
        (self.delay(delay_s) / self.step_s).ceil() + 1.0
    }

    fn note(&self) -> String {
        let own = match self.reads_within_steps {
            true => format!(
                " Stages of RK4 read commands half a step later than the step begins: each delay is {} s longer than the \
                 model's.",
                0.5 * self.step_s
            ),
            false => String::new(),
        };
        format!(
            "    <!-- MuJoCo 3.5 and later delay commands, those before the start being zero unless mj_initCtrlHistory sets \
             them; for earlier ones, remove nsample, interp and delay.{own} -->\n"
        )
    }
}

fn actuator(name: &str, drive: &Drive, clock: &Clock) -> String {
    let (kind, law) = match drive.position_loop() {
        Some(held) if drive.bias[0] == 0.0 && drive.lag.is_none() => position(held),
        _ => general(drive),
    };
    let mut text = format!("    <{kind} name=\"{name}\" joint=\"{name}\"{law}");
    if let Some(range) = drive.range {
        let _ = write!(
            text,
            " forcelimited=\"true\" forcerange=\"{}\"",
            numbers(range)
        );
    }
    if let Some(delay_s) = drive.delay {
        let _ = write!(
            text,
            " nsample=\"{}\" interp=\"linear\" delay=\"{}\"",
            clock.samples(delay_s),
            numbers([clock.delay(delay_s)])
        );
    }
    text + "/>\n"
}

fn position(held: PositionLoop) -> (&'static str, String) {
    let [kp, kv] = [held.stiffness, held.damping].map(|gain| numbers([gain]));
    ("position", format!(" kp=\"{kp}\" kv=\"{kv}\""))
}

fn general(drive: &Drive) -> (&'static str, String) {
    let mut law = attributes(&[("gainprm", drive.gain, 1.0)]);
    if drive.bias != [0.0; 3] {
        let bias = numbers(drive.bias);
        let _ = write!(law, " biastype=\"affine\" biasprm=\"{bias}\"");
    }
    if let Some(time) = drive.lag {
        let _ = write!(law, " dyntype=\"filterexact\" dynprm=\"{time}\"");
    }
    ("general", law)
}
