//! How the acceleration of a joint responds to its torque and its motion.

use serde::Serialize;

use super::motion::Motion;
use super::regressors::regressors;
use crate::data::Joint;
use crate::data::projection::{dot, explained_by, free_of, orthonormal};

/// A regression with fewer rows than this per column says nothing.
const ROWS_A_COLUMN: usize = 10;

/// If the motion itself leaves a smaller share of an acceleration unexplained, the rest does not show how it responds
/// to the torque: a smooth motion of many joints explains its own accelerations.
const LEFT: f64 = 0.01;

/// The acceleration of a joint against a linear regression on its torque, gravity, friction and the accelerations of
/// the other joints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Response {
    /// Share of the acceleration's variance that they explain together.
    pub explained: f64,
    /// Correlation of the acceleration with the torque, after the part that the others explain is removed from both:
    /// above zero in every mechanism, since its mass matrix is positive definite. `None` if the torque is constant, or
    /// if the others explain the torque or nearly all of the acceleration.
    pub to_torque: Option<f64>,
}

/// `None` if the joint has no acceleration or the log is too short; `fast_rad_s` holds the fast speed of every joint.
pub(super) fn response(motions: &[Motion], fast_rad_s: &[f64], joint: Joint) -> Option<Response> {
    let motion = &motions[joint];
    let columns = regressors(motions, fast_rad_s, joint);
    if motion.rows() < ROWS_A_COLUMN * (columns.len() + 1) {
        return None;
    }
    let constant = orthonormal(columns[..1].iter().cloned());
    let mut basis = orthonormal(columns.into_iter());
    let acceleration = &motion.acceleration;
    let varied = left(&constant, acceleration);
    if varied == 0.0 {
        return None;
    }
    let is_open = left(&basis, acceleration) > LEFT * varied;
    let torque = free_of(&basis, &motion.tau).filter(|_| is_open);
    let rest = free_of(&basis, acceleration);
    let to_torque = torque
        .as_ref()
        .zip(rest)
        .map(|(torque, rest)| dot(torque, &rest));
    basis.extend(torque);
    Some(Response {
        explained: 1.0 - left(&basis, acceleration) / varied,
        to_torque,
    })
}

/// Sum of squares of a series that a basis leaves unexplained.
fn left(basis: &[Vec<f64>], series: &[f64]) -> f64 {
    let part = explained_by(basis, series);
    series
        .iter()
        .zip(part)
        .map(|(all, part)| (all - part).powi(2))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::super::joint::audit_joints;
    use super::super::tests::swing;
    use crate::data::log::Log;

    fn response(log: &Log) -> super::Response {
        audit_joints(log).remove(0).response.unwrap()
    }

    #[test]
    fn the_sign_of_the_torque_shows_in_the_acceleration() {
        let mut log = swing();
        let found = response(&log);
        assert!(
            found.explained > 0.99 && found.to_torque.unwrap() > 0.99,
            "{found:?}"
        );
        log.tau[0].iter_mut().for_each(|tau| *tau = -*tau);
        assert!(response(&log).to_torque.unwrap() < -0.99);
        log.tau[0].fill(0.3);
        assert_eq!(response(&log).to_torque, None);
    }
}
