//! How the acceleration of a joint responds to its torque and its motion.

use serde::Serialize;

use super::regression::Regression;
use crate::data::projection::{dot, free_of, unexplained};

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

/// `None` if the joint has no acceleration.
pub(super) fn response(regression: &Regression<'_>) -> Option<Response> {
    let Regression { motion, basis, .. } = regression;
    let left = |rest: Vec<f64>| dot(&rest, &rest);
    let varied = left(unexplained(&basis[..1], &motion.acceleration));
    if varied == 0.0 {
        return None;
    }
    let is_open = left(unexplained(basis, &motion.acceleration)) > LEFT * varied;
    let torque = free_of(basis, &motion.tau).filter(|_| is_open);
    let both = torque.as_ref().zip(regression.acceleration.as_ref());
    let with_torque = basis.iter().chain(&torque);
    Some(Response {
        explained: 1.0 - left(unexplained(with_torque, &motion.acceleration)) / varied,
        to_torque: both.map(|(torque, rest)| dot(torque, rest)),
    })
}

#[cfg(test)]
mod tests {
    use super::super::joint::audit_joints;
    use super::super::tests::swing;
    use crate::data::Columns;
    use crate::data::log::Log;

    fn response(log: &Log) -> super::Response {
        audit_joints(log, &Columns::default())
            .0
            .remove(0)
            .response
            .unwrap()
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
