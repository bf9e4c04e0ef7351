//! Whether the answer can be trusted, in a few lines.

use super::paragraph;
use crate::document::{alarms, proposal_line, structure};
use crate::schema::{EffectEntry, Report};

/// Most remarks besides the residual.
const REMARKS: usize = 2;

pub(super) fn lines(report: &Report) -> Vec<String> {
    let remarks = [
        at_bounds(report),
        harmful(report),
        calibrated(report),
        held(report),
        rivals(report),
        supported(report),
        proposal(report),
    ];
    let remarks = remarks.into_iter().flatten().take(REMARKS);
    let remarks = remarks.flat_map(|text| paragraph("  ", &text));
    let title = vec!["Can I trust it?".to_owned()];
    [title, paragraph("  ", &structure(report))]
        .into_iter()
        .flatten()
        .chain(remarks)
        .collect()
}

/// The remarks on a rig of many joints: lists are counted, and what the table says is left out.
pub(super) fn remarks_in_short(report: &Report) -> impl Iterator<Item = String> {
    let count =
        |count: usize, text: &str| (count > 0).then(|| format!("{text}: {count}, in report.md"));
    let held = report.identifiability.held.len();
    let remarks = [
        at_bounds(report),
        harmful(report),
        calibrated(report),
        count(report.alternatives.len(), "not ruled out"),
        count(held, "held, since the logs do not determine them"),
        proposal(report),
    ];
    remarks.into_iter().flatten()
}

/// Declared parameters that the fit moved to a bound of their range.
fn at_bounds(report: &Report) -> Option<String> {
    let bound = report
        .parameters
        .iter()
        .map(|of| &of.fitted)
        .filter(|of| of.at_bound);
    let bound: Vec<String> = bound
        .map(|of| format!("{} = {}", of.name, of.value))
        .collect();
    (!bound.is_empty()).then(|| {
        format!(
            "at the bound of its range, where no fit should end: {}; is a sign wrong, or a unit?",
            bound.join(", ")
        )
    })
}

/// Effects that the training logs establish, but that raise the error on the test logs by more than a percent. What the
/// motion alone shows is not judged by torques.
fn harmful(report: &Report) -> Option<String> {
    let raise = |effect: &EffectEntry| {
        let rise = -effect.error_reduction?;
        let by_error = effect.motion_reduction.is_none();
        let message = || format!("{} (by {:.0} %)", effect.named(), 100.0 * rise);
        (by_error && rise > 0.01).then(message)
    };
    let effects: Vec<String> = report.effects.iter().filter_map(raise).collect();
    (!effects.is_empty())
        .then(|| format!("raise the error on the test logs: {}", effects.join(", ")))
}

fn calibrated(report: &Report) -> Option<String> {
    let found = report.calibration.as_ref()?;
    Some(format!(
        "{} simulations of the accepted model: {}",
        found.runs,
        alarms(found)
    ))
}

fn held(report: &Report) -> Option<String> {
    let known = &report.identifiability;
    (!known.held.is_empty()).then(|| {
        format!(
            "held, since the logs do not determine them: {}",
            known.held.join(", ")
        )
    })
}

fn rivals(report: &Report) -> Option<String> {
    let rivals = report.alternatives.iter();
    let rivals: Vec<String> = rivals
        .map(|rival| format!("{} on joint {}", rival.title, rival.place))
        .collect();
    (!rivals.is_empty()).then(|| format!("not ruled out: {}", rivals.join(", ")))
}

fn supported(report: &Report) -> Option<String> {
    let effects = report.supported.iter();
    let effects: Vec<String> = effects.map(EffectEntry::named).collect();
    (!effects.is_empty()).then(|| format!("in the model, not established: {}", effects.join(", ")))
}

fn proposal(report: &Report) -> Option<String> {
    report.unexplained.proposal.as_ref().map(proposal_line)
}
