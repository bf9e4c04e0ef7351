//! Angles and velocities both in degrees, recognised by gravity, which varies with the sine of the angle.

use std::f64::consts::TAU;

use super::{Change, Misread, Reading, To};
use crate::data::audit::JointAudit;
use crate::data::audit::motion::Motion;
use crate::data::audit::response::response;
use crate::data::audit::table::short;
use crate::data::column::Quantity;

/// In degrees, a regression has to leave at most this share of the accelerations' variance that it leaves in radians,
const MUCH_BETTER: f64 = 1.0 / 3.0;

/// and to explain this much more of their variance: the last percent is a matter of friction, not of gravity.
const MUCH_MORE: f64 = 0.1;

/// rad
const DEGREE: f64 = TAU / 360.0;

pub(super) fn misread(reading: &Reading<'_>) -> Vec<Misread> {
    // A motion of fewer degrees than a turn has radians is too small to distinguish the two.
    let far = reading
        .joints
        .iter()
        .filter(|joint| joint.moves() && joint.q.range() > TAU);
    let far: Vec<&JointAudit> = far.collect();
    if far.is_empty() {
        return vec![];
    }
    let changes = |joint: &JointAudit| {
        let change = |quantity, unit| Change {
            quantity,
            joint: Some(joint.joint),
            to: To::Unit(unit),
        };
        vec![
            change(Quantity::Angle, "deg"),
            change(Quantity::Velocity, "deg/s"),
        ]
    };
    let in_degrees = reading.motions.iter().map(|motion| motion.scaled(DEGREE));
    let in_degrees: Vec<Motion> = in_degrees.collect();
    let fast = reading.joints.iter();
    let fast: Vec<f64> = fast.map(|joint| DEGREE * joint.fast_rad_s).collect();
    let left = |audit: &JointAudit| {
        let in_degrees = response(&in_degrees, &fast, audit.joint)?;
        Some((1.0 - audit.response?.explained, 1.0 - in_degrees.explained))
    };
    let is_beyond_doubt = |audit: &&JointAudit| {
        let is_much_better = |(radians, degrees): (f64, f64)| {
            degrees < MUCH_BETTER * radians && degrees < radians - MUCH_MORE
        };
        left(audit).is_some_and(is_much_better)
    };
    // One program writes all joints: if one is in degrees, so is every other joint that looks no worse in degrees.
    let any = far.iter().any(is_beyond_doubt);
    let misread = |audit: &&JointAudit| {
        let (radians, degrees) = left(audit)?;
        (any && degrees <= radians).then(|| {
            let q = &audit.q.name;
            Misread {
                joint: Some(audit.joint),
                text: format!(
                    "{q} covers {} rad and reaches {} rad/s, and torque, gravity and friction explain {} % of its \
                     acceleration; with {q} in degrees they explain {} %: {q} and {} look like deg and deg/s",
                    short(audit.q.range()),
                    short(audit.fast_rad_s),
                    short(100.0 * (1.0 - radians)),
                    short(100.0 * (1.0 - degrees)),
                    audit.qd.name
                ),
                changes: changes(audit),
            }
        })
    };
    far.iter().filter_map(misread).collect()
}
