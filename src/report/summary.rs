use std::fmt::Write;

use super::text::{headline, small, values};
use crate::closeloop::Outcome;
use crate::evaluate::{Assessment, summarise};

/// The answer for a terminal: a few lines, and where the rest is.
pub fn summary(outcome: &Outcome, folder: &std::path::Path) -> String {
    let mut out = format!(
        "{}: {}\n",
        headline(outcome).replace("**", ""),
        outcome.reason
    );
    for finding in &outcome.findings {
        let (name, joint) = (finding.effect.title(), finding.effect.joint + 1);
        let _ = writeln!(
            out,
            "  {name} on joint {joint}: {}\n    {}",
            finding.expression,
            values(finding).join("\n    ")
        );
    }
    for &k in &outcome.identifiability.hold {
        let name = &outcome.before.dynamics.parameters[k].name;
        let _ = writeln!(
            out,
            "  {name} is held, the logs do not determine it: the other values are relative to it"
        );
    }
    let joints = outcome.after.dynamics.joints;
    let numbers = |model: &Assessment| summarise(&model.horizons, joints).position_rmse;
    let (before, after) = (
        numbers(&outcome.errors.before),
        numbers(&outcome.errors.after),
    );
    for (h, horizon) in outcome.errors.before.horizons.iter().enumerate() {
        for j in 0..joints {
            let unit = if outcome.prismatic[j] { "m" } else { "rad" };
            let (before, after) = (small(before[h][j]), small(after[h][j]));
            let seconds = horizon.horizon_s;
            let _ = writeln!(
                out,
                "  joint {}, {seconds} s ahead: open-loop error on the test logs {before} {unit} before, {after} {unit} after",
                j + 1
            );
        }
    }
    let _ = writeln!(out, "Report, model and plots are in {}", folder.display());
    out
}
