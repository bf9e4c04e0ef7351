//! Whether the logged torques contain the gravity load of the declared bodies.

use nalgebra::{DMatrix, DVector};

use super::error_model::ErrorModel;
use super::problem::Problem;
use super::settings::NoteSettings;
use crate::data::{Audit, Finding, Severity, Smooth};
use crate::decomposition::least_squares;
use crate::model::Model;
use crate::sim::metric::balance_of;

/// Report in the audits which logs hold another gravity than the declared bodies need, judged by their `shares`: a
/// torque column that is only a part of the torque, a moment in another unit, another base.
pub(super) fn report_gravity(
    shares: &[Option<f64>],
    settings: &NoteSettings,
    audits: &mut [Audit],
) {
    for (share, audit) in shares.iter().zip(audits) {
        if let Some(share) = share.filter(|share| contradicts(*share, settings)) {
            let share = message(share);
            let text = format!("{share}. Effects fitted to them imitate the difference");
            audit.add(Finding::new(Severity::Serious, text));
        }
    }
}

/// Why nothing can be concluded from torques that hold another gravity, in a sentence: judged by the median of the logs
/// that show gravity.
pub(super) fn against_gravity(shares: &[Option<f64>], settings: &NoteSettings) -> Option<String> {
    let mut shares: Vec<f64> = shares.iter().copied().flatten().collect();
    shares.sort_by(f64::total_cmp);
    let median = shares.get(shares.len() / 2).copied();
    let median = message(median.filter(|share| contradicts(*share, settings))?);
    Some(format!("{median}; effects would imitate the difference"))
}

fn contradicts(share: f64, settings: &NoteSettings) -> bool {
    let least = settings.least_gravity;
    !(least..1.0 / least).contains(&share)
}

fn message(share: f64) -> String {
    format!(
        "the logged torques contain {:.0} % of the gravity torque of the declared bodies: they are only a part of the \
         joint torques (a command without the controller's gravity term, say), or the declared masses, the direction \
         of gravity or the unit of the torques is wrong",
        100.0 * share
    )
}

/// The share of the declared gravity in the torques of each log, `None` if gravity hardly loads a joint; empty if
/// motion is compared.
pub(super) fn shares_of_gravity(problem: &Problem<'_>) -> Vec<Option<f64>> {
    if problem.error_model != ErrorModel::InverseDynamics {
        return Vec::new();
    }
    let bodies = problem.declared.without_drive().with_effects(Vec::new());
    let of_log = |log| {
        let smooth = problem.declared.with_drive_torques(log, Smooth::of(log));
        share(&bodies, &smooth, &problem.settings.notes)
    };
    problem.logs.iter().map(of_log).collect()
}

/// The share of the declared gravity in the torques, by least squares together with acceleration, friction and an
/// offset, joint by joint, each weighted by the variance of its gravity; `None` if gravity hardly loads any joint.
fn share(bodies: &Model, smooth: &Smooth, settings: &NoteSettings) -> Option<f64> {
    let balance = bodies.torque_balance()?;
    let (n, rows) = (bodies.joints, smooth.rows());
    let none = vec![vec![0.0; rows]; n];
    let unforced = Smooth {
        tau: none.clone(),
        ..smooth.clone()
    };
    let moving = balance_of(&balance, &unforced, &[]);
    let at_rest = Smooth {
        qd: none.clone(),
        qdd: none,
        ..unforced
    };
    let gravity = balance_of(&balance, &at_rest, &[]);
    let of_joint = |j: usize| {
        let column = |of: &dyn Fn(usize) -> f64| DVector::from_fn(rows, |row, _| of(row));
        let weight = column(&|row| gravity[j][row]);
        let torque = column(&|row| smooth.tau[j][row]);
        let spread = |of: &DVector<f64>| of.variance().sqrt();
        if spread(&weight) < settings.gravity_spread * spread(&torque) {
            return None;
        }
        let varies = weight.variance();
        let columns = [
            weight,
            column(&|row| moving[j][row] - gravity[j][row]),
            column(&|row| smooth.qd[j][row]),
            column(&|row| smooth.qd[j][row].signum()),
            column(&|_| 1.0),
        ];
        let columns = DMatrix::from_columns(&columns);
        let found = least_squares(columns, &torque, 1e-9)?;
        Some((varies, found[0]))
    };
    let message: Vec<(f64, f64)> = (0..n).filter_map(of_joint).collect();
    let all: f64 = message.iter().map(|(varies, _)| varies).sum();
    let held: f64 = message.iter().map(|(varies, share)| varies * share).sum();
    (all > 0.0).then(|| held / all)
}
