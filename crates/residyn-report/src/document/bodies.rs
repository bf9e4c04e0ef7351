//! What the logs determine about the bodies of a chain.

use super::{Block, cells, folded, paragraph, table};
use crate::schema::{CombinationEntry, Report};
use crate::wording::small;
use residyn_core::digits::amount_of;

/// The sums of the bodies' parameters that torques determine; `None` for a model without free bodies.
pub(super) fn bodies(report: &Report) -> Option<Block> {
    let known = &report.identifiability;
    let (determined, at_most) = (known.bodies.len(), known.identifiable_at_most);
    let row = |one: &CombinationEntry| {
        cells([
            one.body.to_string(),
            format!("`{}`", sum(one)),
            small(one.declared),
            amount_of(one.value, Some(one.ci95), &one.unit),
        ])
    };
    (at_most > 0).then(|| {
        let about = format!(
            "Bodies: these logs determine {determined} of the {at_most} sums of parameters that any motion could determine"
        );
        let caution = format!(
            "Within these sums, bodies stay as close to the declared ones as they can: another motion may depend on what only \
             the declared values give.{}",
            poor(determined, at_most)
        );
        let heads = ["body", "sum", "declared", "fitted"];
        let sums = table(1, heads, known.bodies.iter().map(row));
        folded(about, vec![paragraph(caution), sums])
    })
}

/// Logs that determine less than this share of what a motion could determine excite an arm poorly.
const WELL: f64 = 0.8;

/// What to do about poor excitation.
#[allow(clippy::cast_precision_loss)] // few sums
fn poor(identifiable: usize, identifiable_at_most: usize) -> &'static str {
    match (identifiable as f64) < WELL * identifiable_at_most as f64 {
        true => {
            " That is poor excitation: move all joints at once, over more of their range and fast enough that their \
             inertia shows next to gravity and friction."
        }
        false => "",
    }
}

/// `zz_2 + 0.3 m_3 - 1.2 mx_3`
fn sum(one: &CombinationEntry) -> String {
    let part = |(k, (name, weight)): (usize, &(String, f64))| {
        let sign = match (k, *weight < 0.0) {
            (0, _) => "",
            (_, true) => " - ",
            (_, false) => " + ",
        };
        let size = weight.abs();
        match (size - 1.0).abs() < 5e-4 {
            true => format!("{sign}{name}"),
            false => format!("{sign}{size:.3} {name}"),
        }
    };
    let parts: Vec<String> = one.sum.iter().enumerate().map(part).collect();
    parts.concat()
}
