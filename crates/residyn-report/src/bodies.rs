//! What the logs tell of the bodies of a chain.

use std::fmt::Write;

use super::schema::{CombinationEntry, Report};
use residyn_core::digits::amount_of;

/// The combinations of parameters that torques tell, body by body; empty for a model without free bodies.
pub(super) fn bodies(report: &Report) -> String {
    let (told, tellable) = (
        &report.identifiability.bodies,
        report.identifiability.tellable,
    );
    if tellable == 0 {
        return String::new();
    }
    let mut out = format!(
        "## What the logs tell of the bodies\n\nTorques depend on {tellable} sums of the bodies' parameters, of which these logs \
         tell {}. Where the sums stay as they are, bodies are as near to the declared ones as they can be: another motion may need \
         what only the declared values tell.{}\n\n| body | sum | declared | fitted |\n|---|---|---|---|\n",
        told.len(),
        poor(told.len(), tellable)
    );
    for one in told {
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

/// Logs excite an arm poorly that tell less than this share of what a motion could.
const WELL: f64 = 0.8;

/// What to do where the motion tells little.
#[allow(clippy::cast_precision_loss)] // few sums
pub(super) fn poor(told: usize, tellable: usize) -> &'static str {
    match (told as f64) < WELL * tellable as f64 {
        true => {
            " That is poor excitation: move all joints at once, over more of their range and fast enough that their \
             inertia shows beside gravity and friction."
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
