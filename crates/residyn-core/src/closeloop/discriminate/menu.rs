use std::f64::consts::TAU;

use super::motion::{Motion, is_turn};
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::data::statistics::median;
use crate::data::{Joint, Log, Quantity, row_after};

/// The torque, or the command, of an experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Drive {
    /// The logged one times a factor, run at another pace.
    Logged {
        factor: f64,
        pace: f64,
    },
    /// The logged one plus, on one joint, this many times its largest value.
    Added(f64),
    /// A triangle on one joint, from zero up, down and back, with this share of its largest value.
    Ramps(f64),
    /// A triangle on one joint that turns back again and again, each time further, up to this share of its largest value.
    Reversals(f64),
    /// A sine on one joint, with this share of its largest value, that becomes faster: up to [`ROWS_OF_CHIRP`] a period.
    Chirp(f64),
    Nothing,
}

/// Periods of a motion of growing reversals.
const REVERSALS: f64 = 8.0;
/// Where chirps begin, and the rows of their last period: what one cannot see with these, the logs' sampling does not show.
const CHIRP_FROM_HZ: f64 = 0.2;
const ROWS_OF_CHIRP: f64 = 8.0;

/// Where motions begin.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Start {
    /// In logged states, with velocities times a factor.
    Logged(f64),
    /// In logged states, with one joint at this many times its top speed.
    TopSpeed(f64),
    /// At rest, where each log begins.
    Rest,
}

/// One experiment that the logged rig might do.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MenuItem {
    /// What to do; `{joint}`, `{speed}` (rad/s or m/s), `{driving}` (torque or command), `{size}` and `{hz}` stand for
    /// values from the logs.
    text: &'static str,
    drive: Drive,
    start: Start,
    /// Number of rows in place of each logged row.
    finer: u32,
    /// Whether the item applies only if the joint then makes full turns.
    turns: bool,
}

const AS_LOGGED: MenuItem = MenuItem {
    text: "longer logs of the same motion",
    drive: Drive::Logged {
        factor: 1.0,
        pace: 1.0,
    },
    start: Start::Logged(1.0),
    finer: 1,
    turns: false,
};

const fn logged(text: &'static str, factor: f64, pace: f64, speed: f64) -> MenuItem {
    MenuItem {
        text,
        drive: Drive::Logged { factor, pace },
        start: Start::Logged(speed),
        ..AS_LOGGED
    }
}

const fn coasting(text: &'static str, speed: f64) -> MenuItem {
    MenuItem {
        text,
        drive: Drive::Nothing,
        start: Start::TopSpeed(speed),
        ..AS_LOGGED
    }
}

const fn turning(text: &'static str, torque: f64) -> MenuItem {
    MenuItem {
        text,
        drive: Drive::Added(torque),
        turns: true,
        ..AS_LOGGED
    }
}

const fn shaped(text: &'static str, drive: Drive) -> MenuItem {
    MenuItem {
        text,
        drive,
        start: Start::Rest,
        ..AS_LOGGED
    }
}

/// Ordered by how little each item changes the user's experiment.
const MENU: [MenuItem; 15] = [
    AS_LOGGED,
    MenuItem {
        text: "the same motion sampled four times as often",
        finer: 4,
        ..AS_LOGGED
    },
    logged("half the {driving}", 0.5, 1.0, 0.5),
    logged("double the {driving}", 2.0, 1.0, 2.0),
    logged(
        "the same {driving} profile at a third of the speed",
        1.0,
        1.0 / 3.0,
        1.0 / 3.0,
    ),
    logged(
        "the same {driving} profile at twice the speed",
        1.0,
        2.0,
        1.0,
    ),
    logged("the {driving} with its sign reversed", -1.0, 1.0, -1.0),
    shaped(
        "slow {driving} ramps on joint {joint} from standstill to {size}, up and down",
        Drive::Ramps(0.5),
    ),
    shaped(
        "small reversals of joint {joint}, by a triangular {driving} that grows from nothing to {size}",
        Drive::Reversals(0.3),
    ),
    shaped(
        "a chirp on joint {joint} from {hz}, with a {driving} of {size}",
        Drive::Chirp(0.3),
    ),
    shaped(
        "a chirp on joint {joint} from {hz}, with a {driving} of {size}",
        Drive::Chirp(1.0),
    ),
    coasting(
        "let joint {joint} coast without torque from its top speed of {speed}",
        1.0,
    ),
    coasting(
        "let joint {joint} coast without torque from {speed}, twice its top speed",
        2.0,
    ),
    turning(
        "full turns of joint {joint}, with a constant {size} added to its {driving}",
        1.0,
    ),
    turning(
        "full turns of joint {joint}, with a constant {size} added to its {driving}",
        2.0,
    ),
];

/// An experiment ready to be simulated.
pub(super) struct Experiment {
    pub text: String,
    pub motions: Vec<Motion>,
    /// A joint that must make a full turn.
    pub turns: Option<Joint>,
}

/// Experiments that the logged rig could do to distinguish effects on these joints. `fitted` is fitted to the logs:
/// motions begin at its start states.
pub(super) fn experiments(
    problem: &Problem<'_>,
    fitted: &Fitted,
    joints: &[Joint],
) -> Vec<Experiment> {
    let of_one_joint = |item: &MenuItem| item.text.contains("{joint}");
    let mut all = Vec::new();
    for item in &MENU {
        let joints = match of_one_joint(item) {
            true => joints,
            false => &[Joint::at(0)],
        };
        let able = joints
            .iter()
            .filter(|joint| item.is_possible(problem, **joint));
        all.extend(able.map(|&joint| Experiment {
            text: item.words(problem, joint),
            motions: item.motions(problem, fitted, joint),
            turns: item.turns.then_some(joint),
        }));
    }
    all
}

/// Motions under the logged torque, for an experiment that changes the rig.
pub(super) fn as_logged(problem: &Problem<'_>, fitted: &Fitted) -> Vec<Motion> {
    AS_LOGGED.motions(problem, fitted, Joint::at(0))
}

impl MenuItem {
    fn is_possible(&self, problem: &Problem<'_>, joint: Joint) -> bool {
        // A zero command gives zero torque only if commands are torques.
        let coasts = problem.declared.driven_by() == Quantity::Torque;
        let driven = match self.drive {
            _ if *self == AS_LOGGED => true,
            Drive::Nothing => coasts,
            Drive::Logged { .. } => problem.top_driving.iter().any(|top| *top > 0.0),
            _ => problem.top_driving[joint] > 0.0,
        };
        let fastest_s = problem.settings.discriminate.fastest_sampling_s;
        let coarse = (problem.logs.iter()).all(|log| log.median_step() >= fastest_s);
        driven
            && (self.finer == 1 || coarse)
            && !(self.turns && (problem.declared.prismatic[joint] || goes_round(problem, joint)))
    }

    fn words(&self, problem: &Problem<'_>, joint: Joint) -> String {
        let (force, length) = match problem.declared.prismatic[joint] {
            true => (" N", "m"),
            false => (" N m", "rad"),
        };
        let (driving, unit) = match problem.declared.driven_by() {
            Quantity::Torque => ("torque", force),
            _ => ("command", ""),
        };
        let size = self.drive.of_one_joint() * problem.top_driving[joint];
        let steps_s: Vec<f64> = problem.logs.iter().map(Log::median_step).collect();
        let hz = 1.0 / (ROWS_OF_CHIRP * median(&steps_s));
        let speed = match self.start {
            Start::TopSpeed(factor) => factor * problem.top_speed[joint],
            _ => 0.0,
        };
        self.text
            .replace("{joint}", &joint.to_string())
            .replace("{driving}", driving)
            .replace("{size}", &format!("{size:.2}{unit}"))
            .replace("{hz}", &format!("{CHIRP_FROM_HZ} to {hz:.0} Hz"))
            .replace("{speed}", &format!("{speed:.1} {length}/s"))
    }

    fn motions(&self, problem: &Problem<'_>, fitted: &Fitted, joint: Joint) -> Vec<Motion> {
        let motions = problem.settings.discriminate.motions;
        let windows = &problem.shooting.windows;
        let first_of_log = |w: &usize| *w == 0 || windows[*w].log != windows[*w - 1].log;
        let starts: Vec<usize> = match self.start {
            Start::Rest => {
                let firsts = (0..windows.len()).filter(first_of_log);
                firsts.take(motions).collect()
            }
            _ => spread(windows.len(), motions),
        };
        let states = &fitted.fit.start_states;
        let motion = |w: usize| self.motion(problem, w, &states[w], joint);
        starts.into_iter().map(motion).collect()
    }

    /// One motion that begins like window `w` of the logs.
    fn motion(&self, problem: &Problem<'_>, w: usize, state: &[f64], joint: Joint) -> Motion {
        let settings = &problem.settings.discriminate;
        let window = problem.shooting.windows[w];
        let log = &problem.logs[window.log];
        let length_s = match self.drive.is_shaped() {
            true => settings.ramp_period_s,
            false => settings.motion_s,
        };
        let step_s = (log.median_step() / f64::from(self.finer)).max(length_s / settings.most_rows);
        let rows = (length_s / step_s).round() as usize;
        let top = problem.top_driving[joint];
        let (begin, end) = (log.time[window.first], log.time[log.rows() - 1]);
        let mut motion = Motion {
            log: window.log,
            start: self.state(problem, state, joint),
            time: Vec::new(),
            tau: Vec::new(),
            measured: Vec::new(),
        };
        for row in 0..=rows {
            let since = row as f64 * step_s;
            let pace = match self.drive {
                Drive::Logged { pace, .. } => pace,
                _ => 1.0,
            };
            let at = begin + pace * since;
            if at > end && !(self.drive.is_shaped() || self.drive == Drive::Nothing) {
                break;
            }
            let held = row_after(&log.time, at).max(1) - 1;
            let logged = log.tau.iter().map(|tau| tau[held]);
            motion.time.push(begin + since);
            motion.measured.push(log.measured_at(held));
            motion.tau.push(match self.drive {
                Drive::Logged { factor, .. } => logged.map(|tau| factor * tau).collect(),
                Drive::Added(share) => with(logged, joint, share * top),
                drive => {
                    let shape = drive.shape(since / length_s, (length_s, step_s));
                    with(
                        logged.map(|_| 0.0),
                        joint,
                        drive.of_one_joint() * top * shape,
                    )
                }
            });
        }
        motion
    }

    fn state(&self, problem: &Problem<'_>, logged: &[f64], joint: Joint) -> Vec<f64> {
        let mut state = logged.to_vec();
        let velocities = &mut state[problem.declared.joints..];
        match self.start {
            Start::Logged(factor) => velocities.iter_mut().for_each(|v| *v *= factor),
            Start::TopSpeed(factor) => {
                velocities[joint] = (factor * problem.top_speed[joint]).copysign(velocities[joint]);
            }
            Start::Rest => velocities.fill(0.0),
        }
        state
    }
}

impl Drive {
    /// Its size, as a share of the joint's largest torque or command; 0 if it is not that of one joint.
    fn of_one_joint(self) -> f64 {
        match self {
            Self::Added(share)
            | Self::Ramps(share)
            | Self::Reversals(share)
            | Self::Chirp(share) => share,
            Self::Logged { .. } | Self::Nothing => 0.0,
        }
    }

    /// Whether it has a shape of its own, whatever was logged.
    fn is_shaped(self) -> bool {
        matches!(self, Self::Ramps(_) | Self::Reversals(_) | Self::Chirp(_))
    }

    /// The shape, between -1 and 1, when this share of a motion of `length_s` in rows of `step_s` is over.
    fn shape(self, share: f64, (length_s, step_s): (f64, f64)) -> f64 {
        match self {
            Self::Ramps(_) => triangle(share),
            Self::Reversals(_) => share * triangle((REVERSALS * share).fract()),
            Self::Chirp(_) => chirp(share, length_s, 1.0 / (ROWS_OF_CHIRP * step_s)),
            Self::Logged { .. } | Self::Added(_) | Self::Nothing => 0.0,
        }
    }
}

/// A sine whose frequency grows exponentially to `to_hz` at the end of its length.
fn chirp(share: f64, length_s: f64, to_hz: f64) -> f64 {
    let growth = (to_hz / CHIRP_FROM_HZ).ln();
    let cycles = CHIRP_FROM_HZ * length_s * (growth * share).exp_m1() / growth;
    (TAU * cycles).sin()
}

/// Torques or commands with `more` added on one joint.
fn with(driving: impl Iterator<Item = f64>, joint: Joint, more: f64) -> Vec<f64> {
    let mut driving: Vec<f64> = driving.collect();
    driving[joint] += more;
    driving
}

/// 0, up to 1, down to -1 and back to 0 as `phase` goes from 0 to 1.
fn triangle(phase: f64) -> f64 {
    let quarters = 4.0 * phase;
    if quarters < 1.0 {
        quarters
    } else if quarters < 3.0 {
        2.0 - quarters
    } else {
        quarters - 4.0
    }
}

/// Whether the logs show full turns of the joint.
fn goes_round(problem: &Problem<'_>, joint: Joint) -> bool {
    let mut logs = problem.logs.iter();
    logs.any(|log| is_turn(&log.q[joint]))
}

/// At most `most` evenly spread numbers below `count`.
pub(super) fn spread(count: usize, most: usize) -> Vec<usize> {
    let taken = count.min(most);
    (0..taken).map(|k| k * count / taken).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angles at which a chirp of 8 s to 50 Hz has gone through its zeros tell its frequency.
    #[test]
    fn a_chirp_goes_from_its_first_to_its_last_frequency() {
        let at = |t_s: f64| chirp(t_s / 8.0, 8.0, 50.0);
        let crossings = |from_s: f64, to_s: f64| {
            let times = (0..=10_000).map(|k| from_s + (to_s - from_s) * f64::from(k) / 1e4);
            let signs: Vec<bool> = times.map(|t_s| at(t_s) > 0.0).collect();
            signs.windows(2).filter(|pair| pair[0] != pair[1]).count()
        };
        assert_eq!(at(0.0), 0.0);
        // A quarter of a period at 0.2 Hz is reached a little before 1.25 s; in the last 0.2 s there are 9.3 of 10 periods.
        assert_eq!(crossings(0.01, 1.0), 0);
        assert!(
            (18..=20).contains(&crossings(7.8, 8.0)),
            "{}",
            crossings(7.8, 8.0)
        );
    }

    #[test]
    fn reversals_grow() {
        let shape = |share| Drive::Reversals(0.3).shape(share, (8.0, 0.01));
        assert_eq!(shape(0.0), 0.0);
        let first = shape(0.25 / REVERSALS);
        let last = shape((REVERSALS - 0.75) / REVERSALS);
        assert!(0.0 < first && first < 0.04 && last > 0.9, "{first} {last}");
    }
}
