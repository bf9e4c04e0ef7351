//! Effort limits of drives, and notes on drives that are more than a torque source.

use std::collections::HashMap;

use roxmltree::Node;

use super::classes::Classes;
use crate::formats::robot::element::Element;
use crate::formats::xml::{Source, elements, named};
use crate::model::FileError;

/// The effort limit (N m or N) of each joint whose drive has one.
pub(super) fn efforts<'s, 'x>(
    source: &'s Source<'x>,
    root: Node<'s, 'x>,
    classes: &Classes<'s, 'x>,
    autolimits: bool,
) -> Result<HashMap<String, f64>, FileError> {
    let mut efforts = HashMap::new();
    let mut driven = Vec::new();
    for node in named(root, "actuator").flat_map(elements) {
        let kind = node.tag_name().name();
        let drive = classes.element(node, classes.outermost(), &["general", kind])?;
        let name = drive.text("name").unwrap_or(kind);
        let Some(joint) = drive.text("joint").filter(|_| is_plain(&drive, kind)) else {
            drive.note(format!(
                "{kind} `{name}` is not carried: tau is the torque or force at the joint"
            ));
            continue;
        };
        if driven.contains(&joint) {
            source.note(node, format!("`{name}` is a second drive of `{joint}`; tau is the sum, its limit is not carried"));
            efforts.remove(joint);
            continue;
        }
        driven.push(joint);
        let gear = drive
            .list("gear")?
            .and_then(|gears| gears.first().copied())
            .unwrap_or(1.0);
        #[allow(clippy::float_cmp)] // as written
        if gear != 1.0 {
            drive.note(format!("`{name}` has the gear {gear}: tau is the torque or force at `{joint}`, {gear} times the control"));
        }
        if let Some(limit) = limit(&drive, autolimits)? {
            efforts.insert(joint.to_owned(), gear.abs() * limit);
        }
    }
    Ok(efforts)
}

/// Whether the drive is a pure torque source: no dynamics, no bias, fixed gain.
fn is_plain(drive: &Element<'_, '_>, kind: &str) -> bool {
    let plain = |key: &str, value: &str| drive.text(key).is_none_or(|text| text == value);
    let gain = drive
        .text("gainprm")
        .and_then(|text| text.split_whitespace().next());
    let of_general = plain("dyntype", "none")
        && plain("biastype", "none")
        && plain("gaintype", "fixed")
        && gain.is_none_or(|gain| gain == "1");
    kind == "motor" || kind == "general" && of_general
}

/// The smaller of the limits of the control and of the force, before the gear.
fn limit(drive: &Element<'_, '_>, autolimits: bool) -> Result<Option<f64>, FileError> {
    let mut limit: Option<f64> = None;
    for (range, switch) in [("ctrlrange", "ctrllimited"), ("forcerange", "forcelimited")] {
        let given = drive.limits(range, switch, autolimits)?;
        let own = given.and_then(|given| symmetric(drive, given, range));
        limit = [limit, own].into_iter().flatten().reduce(f64::min);
    }
    Ok(limit)
}

/// The bound of a range that is symmetric about zero; others are noted.
pub(super) fn symmetric(
    element: &Element<'_, '_>,
    [low, high]: [f64; 2],
    key: &str,
) -> Option<f64> {
    #[allow(clippy::float_cmp)] // as written
    if low == -high {
        return Some(high);
    }
    element.note(format!(
        "`{key}` from {low} to {high} is not symmetric and is not carried"
    ));
    None
}
