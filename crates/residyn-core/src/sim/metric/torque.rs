//! The torque error: the model's inverse dynamics compared with the logged torques.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::data::{Joint, Log, Measured, Smooth, Smoothing, TorqueColumn};
use crate::lanes::Row;
use crate::model::{Dynamics, Model};
use crate::sim::{Commands, Point, internal_along};

/// Rows that are evaluated side by side.
const LANES: usize = 8;

/// The difference between the torques that a motion needs and those that act, over all rows of all logs at which the
/// joint does not rest in dry friction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TorqueError {
    /// Root mean square of each joint, N m (or N); zero for a joint of which no row counts.
    pub rms: Vec<f64>,
    /// The norm of all differences relative to that of all logged torques; infinite (null in files) if these are zero.
    #[serde(deserialize_with = "infinite_where_null")]
    #[schemars(with = "Option<f64>")]
    pub relative: f64,
    /// Squares of the differences of all joints, summed over blocks of two seconds of each log.
    #[serde(skip)]
    pub blocks: Vec<f64>,
}

impl TorqueError {
    /// `relative` in percent; in words if there is no such share.
    pub fn share(&self) -> String {
        match self.relative.is_finite() {
            true => format!("{:.2} %", 100.0 * self.relative),
            false => "no percentage, the logged torques are zero".to_owned(),
        }
    }
}

fn infinite_where_null<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    let number = Option::<f64>::deserialize(from)?;
    Ok(number.unwrap_or(f64::INFINITY))
}

/// Errors are taken as independent beyond this time, s.
const STRETCH_S: f64 = 2.0;

/// The torque error on logs, each smoothed by [`Smooth`]. Rows at which a joint rests do not count for it if it has dry
/// friction. `None` for a model that gives accelerations, and if no log is longer than a second.
pub fn torque_error(model: &Model, logs: &[Log]) -> Option<TorqueError> {
    torque_error_with(model, logs, &model.dry_joints())
}

/// The same, with dry friction on the joints that are `dry`: errors of models that differ in friction are compared over
/// the same rows.
fn torque_error_with(model: &Model, logs: &[Log], dry: &[bool]) -> Option<TorqueError> {
    let balance = model.torque_balance()?;
    let of_log = |log: &Log| {
        let (logged, differences) = differences(model, &balance, log);
        Squares::of(&logged, &differences, dry)
    };
    let found: Vec<Squares> = logs.par_iter().map(of_log).collect();
    let rows: usize = found.iter().map(|of| of.rows).sum();
    let sum = |j: usize| -> f64 { found.iter().map(|of| of.sums[j]).sum() };
    let counted = |j: usize| -> usize { found.iter().map(|of| of.counted[j]).sum() };
    let all: f64 = (0..model.joints).map(sum).sum();
    let torques: f64 = found.iter().map(|of| of.torques).sum();
    let relative = match torques > 0.0 {
        true => (all / torques).sqrt(),
        false => f64::INFINITY,
    };
    (rows > 0).then(|| TorqueError {
        rms: (0..model.joints)
            .map(|j| (sum(j) / counted(j).max(1) as f64).sqrt())
            .collect(),
        relative,
        blocks: found.iter().flat_map(|of| of.blocks.clone()).collect(),
    })
}

/// Sums over the rows of a log that count.
struct Squares {
    rows: usize,
    /// Of the differences of each joint, over this many rows.
    sums: Vec<f64>,
    counted: Vec<usize>,
    /// Of the logged torques of all joints.
    torques: f64,
    /// Of the differences of all joints, over each [`STRETCH_S`].
    blocks: Vec<f64>,
}

impl Squares {
    fn of(logged: &Smooth, differences: &[Vec<f64>], dry: &[bool]) -> Self {
        let counts = |joint: usize, row: usize| !(dry[joint] && logged.rests[joint][row]);
        let joints = 0..differences.len();
        let rows: Vec<usize> = (0..logged.rows()).collect();
        let of_joint = |of: &[f64], joint: usize, rows: &[usize]| -> f64 {
            let counting = rows.iter().filter(|row| counts(joint, **row));
            counting.map(|row| of[*row].powi(2)).sum()
        };
        let of_all = |channels: &[Vec<f64>], rows: &[usize]| -> f64 {
            let of_each = channels.iter().enumerate();
            of_each.map(|(joint, of)| of_joint(of, joint, rows)).sum()
        };
        let start = logged.time.first().copied().unwrap_or(0.0);
        let block = |row: &usize| ((logged.time[*row] - start) / STRETCH_S).floor();
        let blocks = rows.chunk_by(|a, b| block(a) == block(b));
        Self {
            rows: rows.len(),
            sums: (joints.clone())
                .map(|joint| of_joint(&differences[joint], joint, &rows))
                .collect(),
            counted: joints
                .map(|joint| rows.iter().filter(|row| counts(joint, **row)).count())
                .collect(),
            torques: of_all(&logged.tau, &rows),
            blocks: blocks.map(|rows| of_all(differences, rows)).collect(),
        }
    }
}

/// Another kind of torques than held ones leaves at most this share of their error.
const CLEARLY: f64 = 0.9;

/// What the torques of logs are, by a model's torque error: held, unless another kind leaves clearly less. `None` if there
/// is no such error.
pub fn torque_column(model: &Model, logs: &[Log]) -> Option<TorqueColumn> {
    let left = TorqueColumn::ALL.map(|column| {
        let logs: Vec<Log> = (logs.iter().cloned())
            .map(|log| log.with_torques(column))
            .collect();
        Some(torque_error(model, &logs)?.relative)
    });
    left[0].map(|_| TorqueColumn::clearest(&left, CLEARLY))
}

/// Where the torques that a model needs for the logged motion are first not finite: the log, and the time in s.
pub fn torques_leave(model: &Model, logs: &[Log]) -> Option<(String, f64)> {
    logs.iter().find_map(|log| {
        let NeededTorques { time, needed, .. } = needed_torques(model, log)?;
        let is_finite = |row: &usize| needed.iter().all(|channel| channel[*row].is_finite());
        let row = (0..time.len()).find(|row| !is_finite(row))?;
        Some((log.name(), time[row]))
    })
}

/// The torques of a log and those that its motion needs, low-pass filtered.
#[derive(Debug, Clone, PartialEq)]
pub struct NeededTorques {
    /// s
    pub time: Vec<f64>,
    /// N m (or N), `[joint][row]`
    pub logged: Vec<Vec<f64>>,
    pub needed: Vec<Vec<f64>>,
}

/// The torques that a log's motion needs according to a model; `None` for a model that gives accelerations.
pub fn needed_torques(model: &Model, log: &Log) -> Option<NeededTorques> {
    let (smooth, differences) = differences(model, &model.torque_balance()?, log);
    let logged = smooth.tau.iter();
    let sum = |(logged, difference): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
        let both = logged.iter().zip(difference);
        both.map(|(logged, difference)| logged + difference)
            .collect()
    };
    Some(NeededTorques {
        needed: logged.zip(&differences).map(sum).collect(),
        time: smooth.time,
        logged: smooth.tau,
    })
}

/// A log, smoothed, with the torques that its drives ask for if it has commands, and the torques that its motion needs
/// beyond those that act, `[joint][row]`.
fn differences(model: &Model, balance: &Dynamics, log: &Log) -> (Smooth, Vec<Vec<f64>>) {
    let in_log = balance.in_log(log);
    let smoothing = Smoothing::of(log);
    let logged = Smooth::by(&smoothing, log, &[]);
    let commands = Commands::of_log(&*in_log, log);
    let means = Joint::all(balance.joints).map(|joint| {
        let means = commands.delivered(joint)?;
        Some(means.iter().map(|mean| mean.value).collect())
    });
    let means: Vec<Option<Vec<f64>>> = means.collect();
    let acting = Smooth {
        tau: smoothing.delivered(log, &smoothing.whole(), (&logged.tau, &means)),
        ..logged.clone()
    };
    let internal = internal_along(&Point::from(&*in_log), log, &commands);
    let internal = smoothing.sampled_in(&smoothing.whole(), &internal);
    let found = balance_of(&in_log, &acting, &internal);
    (model.with_drive_torques(log, logged), found)
}

/// The values of a torque balance along a smoothed motion with its torques, `[joint][row]`; `internal` are its internal
/// states, `[state][row]`.
pub(crate) fn balance_of(
    balance: &Dynamics,
    acting: &Smooth,
    internal: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let values = balance.values();
    let first = balance.program.inputs().len() - values.len();
    let mut tape = balance.program.tape_at::<f64, LANES>(first, &values);
    let measured = Measured::named(&acting.measured, balance.measured_names());
    let mut found = vec![vec![0.0; acting.rows()]; balance.joints];
    for first in (0..acting.rows()).step_by(LANES) {
        let rows: [usize; LANES] = std::array::from_fn(|k| (first + k).min(acting.rows() - 1));
        let of_rows = |channel: &[f64]| Row(rows.map(|row| channel[row]));
        let moving = acting.q.iter().chain(&acting.qd).chain(internal);
        let channels = (moving.chain(&acting.tau))
            .chain(measured.iter().copied())
            .chain([&acting.time])
            .chain(&acting.qdd);
        for (slot, channel) in tape.moving().iter_mut().zip(channels) {
            *slot = of_rows(channel);
        }
        tape.run();
        for (j, found) in found.iter_mut().enumerate() {
            for (row, difference) in rows.iter().zip(tape.output(j).0) {
                found[*row] = difference;
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::{balance_of, torque_error, torque_error_with};
    use crate::data::{Joint, Log, Smooth, TorqueColumn};
    use crate::identify::{LevenbergMarquardt, fit_torques};
    use crate::model::{FittedEffect, Library, Model};

    /// N m
    const LEVEL: f64 = 1.0;

    fn acrobot(level: f64) -> Model {
        let library = Library::built_in();
        let coulomb = library.effect("coulomb_friction").unwrap();
        let mut friction = FittedEffect::absent(coulomb, Joint::at(1));
        friction.values[0].0 = level;
        let model = library.model("acrobot").unwrap();
        model
            .with_effects(vec![friction])
            .with_smoothing_velocities(vec![1e-3; 2])
    }

    /// Angle, velocity and acceleration of a joint that swings out and back for a second, and rests for two.
    fn now_and_then(time: f64) -> [f64; 3] {
        let (phase, w) = (time % 3.0, std::f64::consts::TAU);
        if phase >= 1.0 {
            return [0.0; 3];
        }
        let (sin, cos) = (w * phase).sin_cos();
        let (u, du, ddu) = (1.0 - cos, w * sin, w * w * cos);
        [u * u, 2.0 * u * du, 2.0 * (du * du + u * ddu)].map(|x| 0.2 * x)
    }

    /// Joint 1 swings, joint 2 does now and then; while it rests, friction holds it against a torque.
    fn log() -> Log {
        let time: Vec<f64> = (0..6000).map(|row| 0.005 * f64::from(row)).collect();
        let swing = |t: f64| {
            [
                (2.0 * t).sin(),
                2.0 * (2.0 * t).cos(),
                -4.0 * (2.0 * t).sin(),
            ]
        };
        let channel = |k: usize| -> Vec<Vec<f64>> {
            let first = time.iter().map(|t| swing(*t)[k]).collect();
            vec![first, time.iter().map(|t| now_and_then(*t)[k]).collect()]
        };
        let motion = Smooth {
            q: channel(0),
            qd: channel(1),
            qdd: channel(2),
            tau: vec![vec![0.0; time.len()]; 2],
            measured: Vec::new(),
            directions: Vec::new(),
            rests: Vec::new(),
            time: time.clone(),
        };
        let mut tau = balance_of(&acrobot(LEVEL).torque_balance().unwrap(), &motion, &[]);
        for (tau, t) in tau[1].iter_mut().zip(&time) {
            if now_and_then(*t)[1] == 0.0 {
                *tau += 0.9 * LEVEL;
            }
        }
        Log {
            q: motion.q,
            qd: motion.qd,
            tau,
            time,
            ..Log::empty(2).with_torques(TorqueColumn::Sampled)
        }
    }

    #[test]
    fn rows_at_rest_do_not_count_for_a_joint_with_dry_friction() {
        let (model, logs) = (acrobot(LEVEL), [log()]);
        assert_eq!(model.dry_joints(), [false, true]);
        let counted = torque_error(&model, &logs).unwrap();
        let all = torque_error_with(&model, &logs, &[false; 2]).unwrap();
        // What is left stems from the low pass, about each reversal and rest.
        assert!(counted.rms[1] < 0.7 * all.rms[1], "{counted:?}, {all:?}");
        assert!(counted.relative < 0.5 * all.relative);
        // Joint 1 has none, and so has a model without this effect.
        assert_eq!(counted.rms[0], all.rms[0]);
        let plain = model.with_effects(Vec::new());
        assert_eq!(plain.dry_joints(), [false; 2]);
    }

    #[test]
    fn a_fit_to_torques_learns_nothing_from_a_joint_at_rest() {
        let (start, logs) = (acrobot(0.3), [log()]);
        let found = fit_torques(&LevenbergMarquardt::USUAL, &start, &start, &logs).unwrap();
        let level = found.model.effects[0].values[0].0;
        assert!((level / LEVEL - 1.0).abs() < 0.05, "{level}");
        assert!(
            found.shooting.noise[1] < 0.5 * LEVEL,
            "{:?}",
            found.shooting.noise
        );
    }
}
