//! Angles and velocities both in degrees, told by gravity: it goes with the sine of the angle.

use std::borrow::Cow;
use std::f64::consts::TAU;

use super::{Change, Misread, Reading, To};
use crate::data::audit::JointAudit;
use crate::data::audit::table::short;
use crate::data::column::Quantity;

/// In degrees a regression has to leave at most this share of what it leaves of the accelerations in radians,
const MUCH_BETTER: f64 = 1.0 / 3.0;

/// and to explain this much more of their variance: the last percent is a matter of friction, not of gravity.
const MUCH_MORE: f64 = 0.1;

pub(super) fn misread(reading: &Reading<'_>) -> Vec<Misread> {
    // A motion of fewer degrees than a turn has radians is too small to tell them apart.
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
    let mut log = reading.log.clone().into_owned();
    reading
        .joints
        .iter()
        .flat_map(changes)
        .for_each(|change| change.apply(&mut log));
    let in_degrees = Reading::of(Cow::Owned(log));
    let left = |audit: &JointAudit| {
        let left = |joints: &[JointAudit]| Some(1.0 - joints[audit.joint].response?.explained);
        Some((left(&reading.joints)?, left(&in_degrees.joints)?))
    };
    let is_beyond_doubt = |audit: &&JointAudit| {
        let is_much_better = |(radians, degrees): (f64, f64)| {
            degrees < MUCH_BETTER * radians && degrees < radians - MUCH_MORE
        };
        left(audit).is_some_and(is_much_better)
    };
    // One program writes all joints: where one is in degrees, another is that in degrees looks no worse.
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
