//! What the logs determine about the bodies of a chain.

use std::fmt::Write;

use super::schema::{CombinationEntry, Report};
use residyn_core::digits::amount_of;

/// The combinations of parameters that torques determine, body by body; empty for a model without free bodies.
pub(super) fn bodies(report: &Report) -> String {
    let (identifiable, identifiable_at_most) = (
        &report.identifiability.bodies,
        report.identifiability.identifiable_at_most,
    );
    if identifiable_at_most == 0 {
        return String::new();
    }
    let mut out = format!(
        "## What the logs determine about the bodies\n\nTorques depend on {identifiable_at_most} sums of the bodies' \
         parameters, of which these logs determine {}. Within these sums, bodies stay as close to the declared ones as \
         they can: another motion may depend on what only the declared values give.{}\n\n| body | sum | declared | \
         fitted |\n|---|---|---|---|\n",
        identifiable.len(),
        poor(identifiable.len(), identifiable_at_most)
    );
    for one in identifiable {
        let _ = writeln!(
            out,
            "| {} | `{}` | {:.4} | {} |",
            one.body,
            sum(one),
            one.declared,
            amount_of(one.value, Some(one.ci95), &one.unit)
        );
    }
    out + "\n"
}

/// Logs that determine less than this share of what a motion could determine excite an arm poorly.
const WELL: f64 = 0.8;

/// What to do about poor excitation.
#[allow(clippy::cast_precision_loss)] // few sums
pub(super) fn poor(identifiable: usize, identifiable_at_most: usize) -> &'static str {
    match (identifiable as f64) < WELL * identifiable_at_most as f64 {
        true => {
            " That is poor excitation: move all joints at once, over more of their range and fast enough that their \
             inertia shows next to gravity and friction."
        }
        false => "",
    }
}

/// `zz_2 + 0.3 m_3 - 1.2 mx_3`
pub(super) fn sum(one: &CombinationEntry) -> String {
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
