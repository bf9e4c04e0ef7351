//! Drives of joints: sources of torque, position loops, and their limits.

use std::collections::HashMap;

use roxmltree::Node;

use super::classes::Classes;
use crate::robot::element::Element;
use crate::xml::{Source, elements, named};
use residyn_core::model::FileError;
use residyn_core::model::tree::Servo;

/// What drives a joint.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Drive {
    /// Effort limit, N m or N.
    pub effort: Option<f64>,
    /// The position loop, if the drive is one.
    pub servo: Option<Servo>,
}

/// The drive of each joint that has one.
pub(super) fn drives<'s, 'x>(
    source: &'s Source<'x>,
    root: Node<'s, 'x>,
    classes: &Classes<'s, 'x>,
    autolimits: bool,
) -> Result<HashMap<String, Drive>, FileError> {
    let mut drives: HashMap<String, Drive> = HashMap::new();
    for node in named(root, "actuator").flat_map(elements) {
        let kind = node.tag_name().name();
        let drive = classes.element(node, classes.outermost(), &["general", kind])?;
        let name = drive.text("name").unwrap_or(kind);
        let gear = gear(&drive)?;
        let servo = servo(&drive, kind, gear)?;
        let is_known = servo.is_some() || is_plain(&drive, kind);
        let Some(joint) = drive.text("joint").filter(|_| is_known) else {
            drive.note(format!(
                "{kind} `{name}` is not carried: tau is the torque or force at the joint"
            ));
            continue;
        };
        if let Some(first) = drives.get_mut(joint) {
            source.note(node, format!("`{name}` is a second drive of `{joint}`; tau is the sum, its limit is not carried"));
            first.effort = None;
            continue;
        }
        #[allow(clippy::float_cmp)] // compared as written
        if gear != 1.0 && servo.is_none() {
            drive.note(format!("`{name}` has the gear {gear}: tau is the torque or force at `{joint}`, {gear} times the control"));
        }
        if let Some(delay) = drive.text("delay").filter(|delay| *delay != "0") {
            drive.note(format!(
                "the delay of `{name}`, {delay} s, is not carried; `actuator_delay` is the effect"
            ));
        }
        let ranges: &[_] = match servo {
            None => &[CONTROL, FORCE],
            Some(_) => &[FORCE],
        };
        let effort = limit(&drive, autolimits, ranges)?.map(|limit| gear.abs() * limit);
        if servo.is_some() && effort.is_none() {
            drive.note(format!(
                "`{name}` has no force range: its force is not limited"
            ));
        }
        drives.insert(joint.to_owned(), Drive { effort, servo });
    }
    Ok(drives)
}

fn gear(drive: &Element<'_, '_>) -> Result<f64, FileError> {
    let gears = drive.list("gear")?;
    Ok(gears
        .and_then(|gears| gears.first().copied())
        .unwrap_or(1.0))
}

/// An actuator's position loop: `position`, or `general` with the bias of a position loop.
fn servo(drive: &Element<'_, '_>, kind: &str, gear: f64) -> Result<Option<Servo>, FileError> {
    let number = |key: &str, place: usize| -> Result<Option<f64>, FileError> {
        Ok(drive.list(key)?.and_then(|list| list.get(place).copied()))
    };
    let (stiffness, damping) = match kind {
        "position" => {
            if drive.text("dampratio").is_some() || drive.text("timeconst").is_some() {
                return Ok(None);
            }
            (
                number("kp", 0)?.unwrap_or(1.0),
                number("kv", 0)?.unwrap_or(0.0),
            )
        }
        "general" if drive.text("biastype") == Some("affine") && has_no_dynamics(drive) => {
            let gain = number("gainprm", 0)?.unwrap_or(1.0);
            let bias = [0, 1, 2].map(|place| number("biasprm", place));
            let [constant, by_position, by_velocity] =
                bias.map(|value| value.map(|v| v.unwrap_or(0.0)));
            #[allow(clippy::float_cmp)] // compared as written
            if constant? != 0.0 || by_position? != -gain {
                return Ok(None);
            }
            (gain, -by_velocity?)
        }
        _ => return Ok(None),
    };
    // The command is the position before the gear, and the gear scales the force once more.
    #[allow(clippy::float_cmp)] // compared as written
    let is_direct = gear == 1.0;
    Ok(is_direct.then_some(Servo {
        stiffness,
        damping,
        is_known: false,
    }))
}

fn has_no_dynamics(drive: &Element<'_, '_>) -> bool {
    let plain = |key: &str, value: &str| drive.text(key).is_none_or(|text| text == value);
    plain("dyntype", "none") && plain("gaintype", "fixed")
}

/// Whether the drive is a pure torque source: no dynamics, no bias, fixed gain.
fn is_plain(drive: &Element<'_, '_>, kind: &str) -> bool {
    let gain = drive
        .text("gainprm")
        .and_then(|text| text.split_whitespace().next());
    let of_general = has_no_dynamics(drive)
        && drive.text("biastype").is_none_or(|text| text == "none")
        && gain.is_none_or(|gain| gain == "1");
    kind == "motor" || kind == "general" && of_general
}

/// A range of an actuator, and the switch that enables it.
type Range = [&'static str; 2];
const CONTROL: Range = ["ctrlrange", "ctrllimited"];
const FORCE: Range = ["forcerange", "forcelimited"];

/// The smallest limit in force, before the gear.
fn limit(
    drive: &Element<'_, '_>,
    autolimits: bool,
    ranges: &[Range],
) -> Result<Option<f64>, FileError> {
    let mut limit: Option<f64> = None;
    for [range, switch] in ranges {
        let given = drive.limits(range, switch, autolimits)?;
        let own = given.and_then(|given| symmetric(drive, given, range));
        limit = [limit, own].into_iter().flatten().reduce(f64::min);
    }
    Ok(limit)
}

/// The bound of a range that is symmetric about zero; other ranges are noted.
pub(super) fn symmetric(
    element: &Element<'_, '_>,
    [low, high]: [f64; 2],
    key: &str,
) -> Option<f64> {
    #[allow(clippy::float_cmp)] // compared as written
    if low == -high {
        return Some(high);
    }
    element.note(format!(
        "`{key}` from {low} to {high} is not symmetric and is not carried"
    ));
    None
}
