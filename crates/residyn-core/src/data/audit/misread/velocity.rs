//! Velocities that are not velocities, or whose units do not match those of the angles, judged by the angles'
//! derivatives.

use std::f64::consts::TAU;

use super::{Misread, Reading, To};
use crate::data::audit::JointAudit;
use crate::data::audit::compare::MIN_CORRELATION;
use crate::data::audit::table::short;
use crate::data::column::Quantity;

/// A velocity that correlates less than this with the derivative of its angle is something else.
const SAME_QUANTITY: f64 = 0.5;

/// A ratio within this share of the ratio of two units is taken for that ratio: filters and gear tolerances change a
/// speed by less.
const SAME: f64 = 0.05;

/// A ratio this far from 1 is another unit or a gear ratio.
const SCALE_WRONG: f64 = 0.2;

/// Logged velocity over derivative of the angle, and which column is then in which unit.
const RATIOS: [(f64, Quantity, &str); 4] = [
    (360.0 / TAU, Quantity::Velocity, "deg/s"),
    (TAU / 360.0, Quantity::Angle, "deg"),
    (60.0 / TAU, Quantity::Velocity, "rpm"),
    (TAU, Quantity::Angle, "rev"),
];

pub(super) fn misread(reading: &Reading<'_>) -> Vec<Misread> {
    if reading.log.is_qd_derived {
        return vec![];
    }
    let moving = reading.joints.iter().filter(|joint| joint.moves());
    moving.filter_map(of_joint).collect()
}

fn of_joint(audit: &JointAudit) -> Option<Misread> {
    let (text, quantity, to) = wrong(audit)?;
    Some(Misread::of_joint(audit.joint, text, quantity, to))
}

/// What is wrong, and the change that fixes it. Velocities of opposite sign are handled elsewhere.
fn wrong(audit: &JointAudit) -> Option<(String, Quantity, To)> {
    let (q, qd) = (&audit.q.name, &audit.qd.name);
    let derived = |text: String| {
        let text = format!("{text}: take velocities from {q}");
        Some((text, Quantity::Velocity, To::Derived))
    };
    if audit.qd.constant {
        return derived(format!(
            "{qd} is {} {} throughout while {q} moves",
            short(audit.qd.max),
            audit.qd.unit
        ));
    }
    let check = audit.velocity?;
    if audit
        .opposed
        .is_some_and(|correlation| correlation > MIN_CORRELATION)
    {
        return None;
    }
    if check.correlation < SAME_QUANTITY {
        let correlation = short(check.correlation);
        return derived(format!(
            "{qd} does not follow d{q}/dt (correlation {correlation})"
        ));
    }
    if (check.scale - 1.0).abs() <= SCALE_WRONG {
        return None;
    }
    let text = format!("{qd} is {} times d{q}/dt", short(check.scale));
    let fits = |(size, ..): &&(f64, Quantity, &str)| {
        !audit.slides() && (check.scale / size - 1.0).abs() < SAME
    };
    let Some(&(_, quantity, unit)) = RATIOS.iter().find(fits) else {
        return derived(format!("{text}, an unknown unit or gear ratio"));
    };
    let column = if quantity == Quantity::Angle { q } else { qd };
    Some((
        format!("{text}: {column} looks like {unit}"),
        quantity,
        To::Unit(unit),
    ))
}
