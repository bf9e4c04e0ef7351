use std::collections::HashMap;

use roxmltree::Node;

use crate::robot::tree::Mimics;
use crate::xml::{Source, elements, named};
use residyn_core::model::FileError;

/// What each follower joint follows, by the follower's name. Other constraints are refused.
pub(super) fn mimics(
    source: &Source<'_>,
    root: Node<'_, '_>,
) -> Result<HashMap<String, Mimics>, FileError> {
    let all = named(root, "equality").flat_map(elements);
    let active = all.filter(|constraint| constraint.attribute("active") != Some("false"));
    active.map(|constraint| mimic(source, constraint)).collect()
}

/// A follower and what it follows.
fn mimic(source: &Source<'_>, constraint: Node<'_, '_>) -> Result<(String, Mimics), FileError> {
    let element = source.element(constraint);
    if !constraint.has_tag_name("joint") || element.text("joint2").is_none() {
        let message = "this constraint closes a loop; remove it, or set active=\"false\"";
        return Err(source.error(constraint, message));
    }
    let polynomial = element.list("polycoef")?.unwrap_or(vec![0.0, 1.0]);
    let (offset, ratio) = match polynomial[..] {
        [offset, ratio, ref higher @ ..] if higher.iter().all(|higher| *higher == 0.0) => {
            (offset, ratio)
        }
        _ => {
            let message = "`polycoef` is an offset and a ratio; higher powers are not carried";
            return Err(element.attribute_error("polycoef", message));
        }
    };
    let follower = element.required_text("joint1")?.to_owned();
    let leader = element.required_text("joint2")?.to_owned();
    Ok((
        follower,
        Mimics {
            leader,
            ratio,
            offset,
        },
    ))
}
