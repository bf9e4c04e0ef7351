//! Velocities and torques of opposite sign.

use super::{Misread, Reading, To};
use crate::data::audit::JointAudit;
use crate::data::audit::compare::MIN_CORRELATION;
use crate::data::audit::table::short;
use crate::data::column::Quantity;

/// A torque has the opposite sign if the acceleration follows its negative more closely than this: unknown friction,
/// contacts and delays make single joints of measured rigs respond weakly, but never in the opposite direction.
const AGAINST: f64 = -0.5;

pub(super) fn misread(reading: &Reading<'_>) -> Vec<Misread> {
    reading.joints.iter().filter_map(of_joint).collect()
}

fn of_joint(audit: &JointAudit) -> Option<Misread> {
    let to_torque = audit.response.and_then(|response| response.to_torque);
    let torque = to_torque.filter(|correlation| *correlation < AGAINST);
    let velocity = audit
        .opposed
        .filter(|correlation| *correlation > MIN_CORRELATION);
    let (q, qd, tau) = (&audit.q.name, &audit.qd.name, &audit.tau.name);
    let (quantity, text) = match (velocity, torque) {
        (None, None) => return None,
        (Some(v), None) => (
            Quantity::Velocity,
            format!(
                "{qd} follows -d{q}/dt (correlation {}): it has the opposite sign",
                short(v)
            ),
        ),
        (None, Some(t)) => (
            Quantity::Torque,
            format!(
                "the acceleration of joint {} follows -{tau} (correlation {} with {tau} after gravity and friction): \
                 {tau} has the opposite sign",
                audit.joint,
                short(t)
            ),
        ),
        (Some(v), Some(t)) => (
            Quantity::Angle,
            format!(
                "both {qd} and {tau} go against {q} (correlations {} with its derivative, {} with its acceleration): \
                 {q} has the opposite sign",
                short(-v),
                short(t)
            ),
        ),
    };
    let joint = audit.joint;
    Some(Misread::of_joint(joint, text, quantity, To::Opposite))
}
