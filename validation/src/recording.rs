//! Recording a log: drive the rig, read its sensors.

use rand::{Rng, RngExt};

use super::condition::{Condition, Driving, Loop};
use super::excitation::{Controller, Multisine, Signal, chirp, steps};
use super::machine::{Machine, State};
use super::mechanics::Pair;
use super::motion::STEP_S;
use super::sensors::{Clock, Losses, Speed, sensed};
use super::wires::Wires;
use residyn_core::data::Log;

/// Logs differ in how hard the rig is driven; with more than two logs, the last lies within the range of the others.
pub(super) const STRENGTHS: [f64; 6] = [1.2, 0.5, 0.8, 1.0, 0.7, 0.9];

/// The source of the torque.
enum Source {
    Open(Signal),
    Closed(Multisine, Controller),
    /// The torque follows from this motion.
    Imposed(Multisine),
}

impl Source {
    fn draw(driving: &Driving, how: Loop, effort: &Effort, j: usize, rng: &mut impl Rng) -> Self {
        let Effort { strength, seconds } = *effort;
        let (size, band) = (strength * driving.torque[j], driving.torque_hz);
        let mut multisine = |size: f64| -> Signal {
            let torque = Multisine::draw(size, band, rng);
            Box::new(move |time| torque.at(time))
        };
        match how {
            Loop::Open => Self::Open(multisine(size)),
            Loop::Release => Self::Open(multisine(0.5 * size)),
            Loop::Chirp => Self::Open(chirp(size, band, seconds, rng)),
            Loop::Steps => Self::Open(steps(size, band, seconds, rng)),
            Loop::Imposed => {
                let size = strength * driving.reference[j];
                Self::Imposed(Multisine::draw(size, driving.reference_hz, rng))
            }
            Loop::Closed => {
                let size = strength * driving.reference[j];
                let controller = Controller {
                    stiffness: driving.stiffness[j],
                    damping: driving.damping[j],
                    limit: driving.limit[j],
                    speed: Speed::default(),
                };
                Self::Closed(Multisine::draw(size, driving.reference_hz, rng), controller)
            }
        }
    }

    fn command(&mut self, measured: f64, time: f64, dt: f64) -> f64 {
        match self {
            Self::Open(torque) => torque(time),
            Self::Closed(reference, controller) => {
                let wanted = [reference.at(time), reference.rate(time)];
                controller.command(measured, wanted, dt)
            }
            Self::Imposed(_) => 0.0,
        }
    }
}

/// How hard and how long \[s\] a rig is driven.
struct Effort {
    strength: f64,
    seconds: f64,
}

/// The state at which a log begins: at rest, hanging down or where the rig is released.
fn start(driving: &Driving, how: Loop, strength: f64, rng: &mut impl Rng) -> State {
    let mut q = [0.0; 2];
    if how == Loop::Release {
        for (angle, reference) in q.iter_mut().zip(&driving.reference) {
            let side = if rng.random() { 1.0 } else { -1.0 };
            *angle = side * strength * rng.random_range(1.0..=2.0) * reference;
        }
    }
    State::at_rest(q)
}

impl Machine {
    /// Record the `index`-th log of a rig that starts at rest; encoders read high by `offset` rad. Velocities are
    /// filtered backward differences of the encoder readings. Lost rows are not in the log, while the rig and its
    /// controller continue.
    pub fn record(
        &self,
        driving: &Driving,
        condition: &Condition,
        index: usize,
        offset: Pair,
        rng: &mut impl Rng,
    ) -> Log {
        let (joints, flaws) = (self.joints(), &condition.flaws);
        let how = condition.drive[index % condition.drive.len()];
        let effort = Effort {
            strength: STRENGTHS[index % STRENGTHS.len()],
            seconds: condition.seconds,
        };
        let mut sources: Vec<Source> = (0..joints)
            .map(|j| Source::draw(driving, how, &effort, j, rng))
            .collect();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few thousand
        let rows = (condition.seconds * condition.rate_hz).round() as usize + 1;
        let mut clock = Clock::new(condition.rate_hz, flaws);
        let mut losses = Losses::new(flaws.dropped, flaws.burst);
        let mut speeds = vec![Speed::default(); joints];
        let mut wires = Wires::default();
        let mut state = start(driving, how, effort.strength, rng);
        let mut log = Log::empty(joints);
        log.path = log_name(index).into();
        let (mut time, mut dt) = (0.0, 1.0 / condition.rate_hz);
        for row in 0..rows {
            // The first and the last row are always kept, so that the log has its intended length.
            let kept = !losses.next(rng) || row == 0 || row == rows - 1;
            let needed = self.follow(&sources, time, &mut state);
            let encoders = self.encoders(&state);
            let mut command = [0.0; 2];
            for j in 0..joints {
                let angle = encoders[j] + offset[j];
                let q = sensed(angle, condition.noise, condition.quantum, rng);
                let qd = speeds[j].at(q, dt, flaws.filter_s);
                command[j] = sources[j].command(q, time, dt) + needed[j];
                if kept {
                    log.q[j].push(q);
                    log.qd[j].push(qd);
                    log.tau[j].push(flaws.torque(command[j], driving.limit[j], rng));
                }
            }
            if kept {
                log.time.push(clock.stamp(time, rng));
            }
            wires.issue(time, command);
            let next = clock.next(rng);
            self.hold(&mut state, &mut wires, time, next);
            (dt, time) = (next - time, next);
        }
        log
    }

    /// Moves the joints to where a bench imposes them; the torques that this takes \[N m\].
    fn follow(&self, sources: &[Source], time: f64, state: &mut State) -> Pair {
        let mut acceleration = [0.0; 2];
        for (j, source) in sources.iter().enumerate() {
            let Source::Imposed(path) = source else {
                return [0.0; 2];
            };
            (state.q[j], state.v[j]) = (path.at(time), path.rate(time));
            acceleration[j] = path.acceleration(time);
        }
        self.needed(time, state, acceleration)
    }

    /// Integrates from one reading to the next \[s\], split when a command arrives at a drive.
    fn hold(&self, state: &mut State, wires: &mut Wires, from: f64, to: f64) {
        for span in wires.cuts(self, from, to).windows(2) {
            let given = wires.given(self, span[0]);
            self.advance(state, span[0], span[1] - span[0], &given, STEP_S);
        }
    }
}

/// The name of the `index`-th log, counted from 0.
pub fn log_name(index: usize) -> String {
    format!("log{}.csv", index + 1)
}

#[cfg(test)]
mod tests {
    use crate::condition::{Condition, Driving, Loop};
    use crate::machine::Machine;
    use crate::mechanics::Mechanics;
    use crate::mechanics::tests::pendulum;
    use crate::sensors::{Flaws, repeat};
    use residyn_core::data::Log;
    use residyn_core::rng;

    /// Without gravity.
    const WHEEL: Mechanics = Mechanics::Pendulum {
        inertia: 1.0,
        moment: 0.0,
        g: 9.81,
    };

    fn driving() -> Driving {
        Driving {
            torque: vec![0.6],
            torque_hz: [0.2, 2.0],
            reference: vec![0.6],
            reference_hz: [0.2, 1.0],
            stiffness: vec![10.0],
            damping: vec![1.2],
            limit: vec![4.0],
        }
    }

    fn condition(how: Loop) -> Condition {
        Condition {
            drive: vec![how],
            rate_hz: 100.0,
            noise: 0.0,
            quantum: 0.0,
            logs: 3,
            seconds: 4.0,
            flaws: Flaws::default(),
        }
    }

    fn record(machine: &Machine, condition: &Condition, offset: f64) -> Log {
        let mut rng = rng(1);
        machine.record(&driving(), condition, 0, [offset, 0.0], &mut rng)
    }

    fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
        let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        differences.fold(0.0, f64::max)
    }

    #[test]
    fn a_delay_of_whole_steps_shifts_the_motion_exactly() {
        let sound = Machine::bare(pendulum());
        let late = sound.clone().hiding(0, "actuator_delay", &[("d", 0.03)]);
        let open = condition(Loop::Open);
        let (early, late) = (record(&sound, &open, 0.0), record(&late, &open, 0.0));
        assert_eq!(early.tau, late.tau);
        // The same torque on the same rig, three rows later, from the same rest.
        let rows = early.rows() - 3;
        assert!(largest_difference(&early.q[0][..rows], &late.q[0][3..]) < 1e-12);
    }

    #[test]
    fn a_delay_of_part_of_a_step_splits_the_step_between_two_torques() {
        let machine = Machine::bare(WHEEL).hiding(0, "actuator_delay", &[("d", 0.0137)]);
        let mut condition = condition(Loop::Open);
        condition.seconds = 1.0;
        let log = record(&machine, &condition, 0.0);
        // Speed is the sum of torque times time: in step k, 3.7 ms of command k - 2 and 6.3 ms of k - 1.
        let command = |k: usize, back: usize| k.checked_sub(back).map_or(0.0, |k| log.tau[0][k]);
        let (mut q, mut v) = (0.0, 0.0);
        for row in 0..log.rows() {
            assert!((log.q[0][row] - q).abs() < 1e-12, "row {row}");
            for (torque, h) in [(command(row, 2), 0.0037), (command(row, 1), 0.0063)] {
                q += v * h + 0.5 * torque * h * h;
                v += torque * h;
            }
        }
    }

    #[test]
    fn a_lag_follows_its_own_equation() {
        let machine = Machine::bare(WHEEL).hiding(0, "actuator_lag", &[("T", 0.05)]);
        let log = record(&machine, &condition(Loop::Open), 0.0);
        // Forward steps of 10 us of T tau' + tau = u.
        let (mut q, mut v, mut tau) = (0.0, 0.0, 0.0);
        for row in 0..log.rows() {
            assert!((log.q[0][row] - q).abs() < 1e-4, "row {row}");
            for _ in 0..1000 {
                tau += 1e-5 / 0.05 * (log.tau[0][row] - tau);
                v += 1e-5 * tau;
                q += 1e-5 * v;
            }
        }
    }

    #[test]
    fn a_sensor_offset_does_not_change_open_loop_motion() {
        let machine = Machine::bare(pendulum());
        let open = condition(Loop::Open);
        let (plain, off) = (record(&machine, &open, 0.0), record(&machine, &open, 0.05));
        let shifted: Vec<f64> = plain.q[0].iter().map(|q| q + 0.05).collect();
        assert!(largest_difference(&shifted, &off.q[0]) < 1e-15);
        assert_eq!(plain.tau, off.tau);
    }

    #[test]
    fn closed_loop_torque_depends_on_the_rig_and_respects_its_limit() {
        let closed = condition(Loop::Closed);
        let plain = record(&Machine::bare(pendulum()), &closed, 0.0);
        let rough = Machine::bare(pendulum()).hiding(0, "coulomb_friction", &[("F_c", 0.3)]);
        let rough = record(&rough, &closed, 0.0);
        assert!(largest_difference(&plain.tau[0], &rough.tau[0]) > 0.1);
        assert!(plain.tau[0].iter().all(|tau| tau.abs() <= 4.0));
        assert!(plain.q[0].iter().any(|q| q.abs() > 0.3));
    }

    #[test]
    fn encoders_have_the_configured_noise_and_step_and_velocities_are_differences() {
        let machine = Machine::bare(pendulum()).hiding(0, "viscous_friction", &[("b", 0.1)]);
        let clean = record(&machine, &condition(Loop::Open), 0.0);
        let mut noisy = condition(Loop::Open);
        (noisy.noise, noisy.quantum) = (1e-3, 0.0);
        let noisy = record(&machine, &noisy, 0.0);
        let pairs = clean.q[0].iter().zip(&noisy.q[0]);
        let mean_square = pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 401.0;
        assert!((mean_square.sqrt() - 1e-3).abs() < 1e-4, "{mean_square}");
        let mut coarse = condition(Loop::Open);
        coarse.quantum = 0.01;
        let coarse = record(&machine, &coarse, 0.0);
        let whole = |q: &f64| (q / 0.01 - (q / 0.01).round()).abs() < 1e-9;
        assert!(coarse.q[0].iter().all(whole));
        for row in 1..noisy.rows() {
            let difference = (noisy.q[0][row] - noisy.q[0][row - 1]) / 0.01;
            assert!((noisy.qd[0][row] - difference).abs() < 1e-9);
        }
    }

    #[test]
    fn the_torque_of_an_imposed_motion_carries_friction_in_both_directions() {
        let machine = Machine::bare(WHEEL)
            .hiding(0, "coulomb_friction", &[("F_c", 7.0)])
            .hiding(0, "constant_torque", &[("tau_0", 40.0)]);
        let [path, bare] = [machine, Machine::bare(WHEEL)]
            .map(|machine| record(&machine, &condition(Loop::Imposed), 0.0));
        assert_eq!(path.q, bare.q);
        for row in 1..path.rows() {
            let added = path.tau[0][row] - bare.tau[0][row] + 40.0;
            assert!((added.abs() - 7.0).abs() < 1e-9, "row {row}: {added}");
        }
    }

    #[test]
    fn repeated_rows_hold_the_readings_before_them() {
        let clean = record(&Machine::bare(pendulum()), &condition(Loop::Open), 0.0);
        let mut log = clean.clone();
        let flaws = Flaws {
            repeated: 0.1,
            burst: 3,
            ..Flaws::default()
        };
        repeat(&mut log, &flaws, &mut rng(1));
        let same = (1..log.rows()).filter(|row| log.q[0][*row] != clean.q[0][*row]);
        let same: Vec<usize> = same.collect();
        assert!((20..70).contains(&same.len()), "{same:?}");
        for row in same {
            let of = |row: usize| [log.q[0][row], log.qd[0][row], log.tau[0][row]];
            assert_eq!(of(row), of(row - 1));
        }
        assert_eq!(log.time, clean.time);
    }

    #[test]
    fn lost_rows_are_missing_while_the_rig_goes_on() {
        let machine = Machine::bare(pendulum());
        let mut closed = condition(Loop::Closed);
        let whole = record(&machine, &closed, 0.0);
        (closed.flaws.dropped, closed.flaws.burst) = (0.1, 4);
        let lossy = record(&machine, &closed, 0.0);
        let lost = whole.rows() - lossy.rows();
        assert!((20..70).contains(&lost), "{lost}");
        assert_eq!(lossy.duration(), whole.duration());
        // The remaining rows are unchanged: the controller has seen the lost rows, and the rig has moved under it.
        for (row, time) in lossy.time.iter().enumerate() {
            let there = whole.time.iter().position(|t| t == time).unwrap();
            let of = |log: &Log, row: usize| [log.q[0][row], log.qd[0][row], log.tau[0][row]];
            assert_eq!(of(&lossy, row), of(&whole, there));
        }
    }
}
