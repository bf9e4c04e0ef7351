//! Drives as simulators model them: a torque that is linear in its command and its joint's motion, up to a limit.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use residyn_core::data::Joint;
use residyn_core::expr::Program;

/// torque = clamp(gain * command + constant + by_position * q + by_velocity * qd, -limit, limit)
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Servo {
    pub gain: f64,
    /// Constant (N m or N), by position, by velocity.
    pub bias: [f64; 3],
    pub limit: Option<f64>,
}

/// Command, position or velocity at which every limited drive is beyond its limit.
const FAR: f64 = 1e9;

/// Step of the slopes, near a millionth: a power of two, so that gains come out as they were declared.
const STEP: f64 = 1.0 / (1 << 20) as f64;

/// Number of points at which the form is compared with the drive, and the largest difference relative to the torques.
const POINTS: usize = 256;
const ROUNDING: f64 = 1e-9;

/// The drives of a program with inputs q1.., qd1.., cmd1.., t, then parameters of these `values`.
///
/// # Errors
/// A drive of another form.
pub(super) fn servos(
    program: &Program,
    joints: usize,
    values: &[f64],
) -> Result<Vec<Servo>, String> {
    let found = tangents(program, joints, values).into_iter();
    let check = |(joint, servo): (Joint, Servo)| {
        let j = joint.index();
        let is_same = servo.is_same(&torque(program, values, j), joints, j);
        is_same.then_some(servo).ok_or_else(|| {
            format!(
                "the drive of joint {joint} is not a linear function of its command and its joint's motion, up to a limit"
            )
        })
    };
    Joint::all(joints).zip(found).map(check).collect()
}

/// The forms through single values of the torques of such a program, whether or not the drives have that form elsewhere.
pub(super) fn tangents(program: &Program, joints: usize, values: &[f64]) -> Vec<Servo> {
    let through = |j| Servo::through(&torque(program, values, j), joints, j);
    (0..joints).map(through).collect()
}

/// The torque of joint `j` by positions, velocities and commands.
fn torque(program: &Program, values: &[f64], j: usize) -> impl Fn(&[f64]) -> f64 {
    move |moving| program.eval(&[moving, &[0.0], values].concat())[j]
}

impl Servo {
    /// The form through single values of a joint's torque.
    fn through(torque: &impl Fn(&[f64]) -> f64, joints: usize, j: usize) -> Self {
        let at = |place: usize, value: f64| {
            let mut moving = vec![0.0; 3 * joints];
            moving[place] = value;
            torque(&moving)
        };
        let constant = at(0, 0.0);
        let ends = [at(2 * joints + j, FAR), at(2 * joints + j, -FAR)];
        let largest = ends.into_iter().map(f64::abs).fold(0.0, f64::max);
        // The difference over a step that is far from any limit, unless the drive is nothing but a limit.
        let slope = |place: usize| (at(place, STEP) - at(place, -STEP)) / (2.0 * STEP);
        let gain = slope(2 * joints + j);
        let is_limited = largest < 0.5 * gain.abs() * FAR;
        Self {
            gain,
            bias: [constant, slope(j), slope(joints + j)],
            limit: is_limited.then_some(largest),
        }
    }

    fn torque(&self, moving: &[f64], joints: usize, j: usize) -> f64 {
        let [constant, by_position, by_velocity] = self.bias;
        let motion = by_position * moving[j] + by_velocity * moving[joints + j];
        let free = self.gain * moving[2 * joints + j] + constant + motion;
        self.limit.map_or(free, |limit| free.clamp(-limit, limit))
    }

    /// Whether the form gives the drive's torque at any positions, velocities and commands.
    fn is_same(&self, torque: &impl Fn(&[f64]) -> f64, joints: usize, j: usize) -> bool {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        (0..POINTS).all(|point| {
            // Near rest, and far beyond.
            let reach = 10.0_f64.powi((point % 12) as i32 - 9);
            let mut draw = |_| reach * (2.0 * rng.random::<f64>() - 1.0);
            let moving: Vec<f64> = (0..3 * joints).map(&mut draw).collect();
            let [wanted, found] = [torque(&moving), self.torque(&moving, joints, j)];
            (wanted - found).abs() <= ROUNDING * (self.gain.abs() * reach + wanted.abs())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::servos;
    use residyn_core::expr::{Formula, Program, parse};

    fn drive(formula: &str) -> Program {
        let formula: Formula = parse(formula).unwrap();
        formula.program(["q1", "qd1", "cmd1", "t"]).unwrap()
    }

    #[test]
    fn servos_and_motors_are_recognised() {
        let servo = servos(
            &drive("clamp(20*(cmd1 - q1) - 0.5*qd1 + 0.1, -2, 2)"),
            1,
            &[],
        );
        let servo = servo.unwrap()[0];
        assert!((servo.gain - 20.0).abs() < 1e-6 && servo.limit == Some(2.0));
        let wanted = [0.1, -20.0, -0.5];
        let near = |(found, wanted): (&f64, &f64)| (found - wanted).abs() < 1e-6;
        assert!(servo.bias.iter().zip(&wanted).all(near));
        let motor = servos(&drive("0.3*(cmd1 - 0.3*qd1)/1.2"), 1, &[]).unwrap()[0];
        assert!((motor.gain - 0.25).abs() < 1e-9 && motor.limit.is_none());
    }

    #[test]
    fn other_drives_are_refused() {
        for formula in [
            "cmd1^3",
            "5*sin(cmd1 - q1)",
            "clamp(cmd1, -1, 2)",
            "sign(cmd1)",
        ] {
            let error = servos(&drive(formula), 1, &[]).unwrap_err();
            assert!(
                error.contains("the drive of joint 1 is not a linear function"),
                "{formula}"
            );
        }
    }
}
