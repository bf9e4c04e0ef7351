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
/// offset, joint by joint, each weighted by the variance of its gravity; `None` if gravity hardly loads any joint. A spring or
/// a cable on a joint may look like a part of its gravity, or hide it: the share beside one counts if it is nearer to
/// the whole.
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
            column(&|row| smooth.q[j][row]),
        ];
        let held = |columns: &[DVector<f64>]| {
            let found = least_squares(DMatrix::from_columns(columns), &torque, 1e-9)?;
            Some(found[0])
        };
        let (alone, beside_spring) = (held(&columns[..5])?, held(&columns)?);
        let is_nearer = (beside_spring - 1.0).abs() < (alone - 1.0).abs();
        Some((varies, if is_nearer { beside_spring } else { alone }))
    };
    let message: Vec<(f64, f64)> = (0..n).filter_map(of_joint).collect();
    let all: f64 = message.iter().map(|(varies, _)| varies).sum();
    let held: f64 = message.iter().map(|(varies, share)| varies * share).sum();
    (all > 0.0).then(|| held / all)
}

#[cfg(test)]
mod tests {
    use super::share;
    use crate::closeloop::Settings;
    use crate::data::Smooth;
    use crate::model::Library;
    use crate::sim::metric::balance_of;

    /// The share of gravity in torques that are those of the motion, less gravity if it is compensated for elsewhere, and with a
    /// spring on the last joint.
    fn found(carries_gravity: bool, stiffness: f64) -> f64 {
        let model = Library::built_in().model("acrobot").unwrap();
        let balance = model.torque_balance().unwrap();
        let time: Vec<f64> = (0..2000).map(|row| 0.005 * f64::from(row)).collect();
        let of = |wave: fn(f64) -> f64, power: i32| -> Vec<Vec<f64>> {
            let at = |t: &f64, w: f64| w.powi(power) * wave(w * t);
            let joint = |w: f64| {
                time.iter()
                    .map(|t| at(t, w) + 0.3 * at(t, 2.7 * w))
                    .collect()
            };
            vec![joint(1.1), joint(1.7)]
        };
        let none = vec![vec![0.0; time.len()]; 2];
        let mut smooth = Smooth {
            q: of(f64::sin, 0),
            qd: of(f64::cos, 1),
            qdd: of(|x| -x.sin(), 2),
            tau: none.clone(),
            measured: Vec::new(),
            directions: Vec::new(),
            rests: vec![vec![false; time.len()]; 2],
            time,
        };
        let at_rest = Smooth {
            qd: none.clone(),
            qdd: none,
            ..smooth.clone()
        };
        let [moving, gravity] = [&smooth, &at_rest].map(|of| balance_of(&balance, of, &[]));
        let missing = if carries_gravity { 0.0 } else { 1.0 };
        for (j, spring) in [0.0, stiffness].into_iter().enumerate() {
            for row in 0..smooth.rows() {
                let rest = moving[j][row] - missing * gravity[j][row];
                smooth.tau[j][row] = rest + spring * (smooth.q[j][row] - 0.2);
            }
        }
        share(&model, &smooth, &Settings::default().notes).unwrap()
    }

    #[test]
    fn a_spring_is_not_taken_for_another_gravity() {
        for stiffness in [0.0, 8.0, -8.0] {
            let with = found(true, stiffness);
            assert!((with - 1.0).abs() < 0.1, "{stiffness}: {with}");
            let without = found(false, stiffness);
            assert!(without.abs() < 0.4, "{stiffness}: {without}");
        }
    }
}
