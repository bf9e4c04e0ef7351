//! The torque error: the model's inverse dynamics compared with the logged torques.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::data::{Joint, Log, Smooth, Smoothing, TorqueColumn};
use crate::lanes::Row;
use crate::model::{Dynamics, Model};
use crate::sim::Commands;

/// Rows that are evaluated side by side.
const LANES: usize = 8;

/// The difference between the torques that a motion needs and those that act, over all rows of all logs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TorqueError {
    /// Root mean square of each joint, N m (or N).
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

/// The torque error on logs, each smoothed by [`Smooth`]. `None` for a model that gives accelerations, and if no log is
/// longer than a second.
pub fn torque_error(model: &Model, logs: &[Log]) -> Option<TorqueError> {
    let balance = model.torque_balance()?;
    let found = logs.par_iter().map(|log| differences(&balance, log));
    let found: Vec<(Smooth, Vec<Vec<f64>>)> = found.collect();
    let rows: usize = found.iter().map(|(logged, _)| logged.rows()).sum();
    let squares = |channel: &Vec<f64>| channel.iter().map(|x| x * x).sum::<f64>();
    let of_joint = |j: usize| -> f64 { found.iter().map(|(_, of)| squares(&of[j])).sum() };
    let differences: Vec<f64> = (0..model.joints).map(of_joint).collect();
    let of_torques = |logged: &Smooth| logged.tau.iter().map(squares).sum::<f64>();
    let torques: f64 = found.iter().map(|(logged, _)| of_torques(logged)).sum();
    (rows > 0).then(|| TorqueError {
        rms: (differences.iter())
            .map(|sum| (sum / rows as f64).sqrt())
            .collect(),
        relative: (differences.iter().sum::<f64>() / torques).sqrt(),
        blocks: found.iter().flat_map(blocks).collect(),
    })
}

/// The squares of the differences of all joints, summed over each [`STRETCH_S`] of a log.
fn blocks((logged, differences): &(Smooth, Vec<Vec<f64>>)) -> Vec<f64> {
    let start = logged.time.first().copied().unwrap_or(0.0);
    let block = |row: &usize| ((logged.time[*row] - start) / STRETCH_S).floor();
    let square = |row: &usize| differences.iter().map(|of| of[*row].powi(2)).sum::<f64>();
    let rows: Vec<usize> = (0..logged.rows()).collect();
    let blocks = rows.chunk_by(|a, b| block(a) == block(b));
    blocks.map(|rows| rows.iter().map(square).sum()).collect()
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
    let (smooth, differences) = differences(&model.torque_balance()?, log);
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

/// A log, smoothed, and the torques that its motion needs beyond those that act, `[joint][row]`.
fn differences(balance: &Dynamics, log: &Log) -> (Smooth, Vec<Vec<f64>>) {
    let in_log = balance.in_log(log);
    let smoothing = Smoothing::of(log);
    let logged = Smooth::by(&smoothing, log, &[]);
    let commands = Commands::of_log(&*in_log, log);
    let of_joint = |(joint, tau): (Joint, &Vec<f64>)| match commands.delivered(joint) {
        Some(means) => {
            let means: Vec<f64> = means.iter().map(|mean| mean.value).collect();
            smoothing.delivered(log, joint.index(), &means)
        }
        None => tau.clone(),
    };
    let acting = Joint::all(balance.joints).zip(&logged.tau).map(of_joint);
    let acting = Smooth {
        tau: acting.collect(),
        ..logged.clone()
    };
    let found = balance_of(&in_log, &acting);
    (logged, found)
}

/// The values of a torque balance along a smoothed motion with its torques, `[joint][row]`.
pub(crate) fn balance_of(balance: &Dynamics, acting: &Smooth) -> Vec<Vec<f64>> {
    let values = balance.values();
    let first = balance.program.inputs().len() - values.len();
    let mut tape = balance.program.tape_at::<f64, LANES>(first, &values);
    let mut found = vec![vec![0.0; acting.rows()]; balance.joints];
    for first in (0..acting.rows()).step_by(LANES) {
        let rows: [usize; LANES] = std::array::from_fn(|k| (first + k).min(acting.rows() - 1));
        let of_rows = |channel: &[f64]| Row(rows.map(|row| channel[row]));
        let channels = (acting.q.iter().chain(&acting.qd).chain(&acting.tau))
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
