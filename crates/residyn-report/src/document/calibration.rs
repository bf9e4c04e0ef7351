//! What the logs could show, found by simulation.

use std::fmt::Write;

use super::{Block, cells, folded, heading, paragraph, table};
use crate::calibration::{CalibrationEntry, EffectEntry, SmallestEntry};
use crate::wording::{listed, small};
use residyn_core::digits::with_unit;

pub(super) fn calibration(found: &CalibrationEntry) -> Vec<Block> {
    let simulations = format!(
        "{} simulations of the accepted model were searched like the logs themselves, driven by the torques of the training \
         logs and with the residuals of the fit as noise. {}.",
        found.runs,
        alarms(found)
    );
    let limits = format!(
        "The table gives the smallest size at which the search would name each effect in four of five such sets of logs. As a \
         check, common effects were hidden in a simulation at {} times that size.",
        found.hidden_at
    );
    let heads = [
        "effect",
        "joint",
        "smallest size",
        "share of the top torque",
        "hidden in a simulation",
    ];
    let row = |one: &SmallestEntry| {
        let joint = one.joint.to_string();
        cells([one.title.clone(), joint, size(one), share(one), hidden(one)])
    };
    vec![
        heading("What these logs could show"),
        paragraph(simulations),
        folded(
            "The smallest size of each effect that would be named",
            vec![
                paragraph(limits),
                table(1, heads, found.smallest.iter().map(row)),
            ],
        ),
    ]
}

/// How often an absent effect was named.
pub(crate) fn alarms(calibration: &CalibrationEntry) -> String {
    let [low, high] = calibration.rate_ci95.map(|share| 100.0 * share);
    let mut out = format!(
        "{} named an effect that is absent: {:.0} % false alarms (95 % interval {low:.0} to {high:.0} %)",
        calibration.alarms,
        100.0 * calibration.rate,
    );
    if !calibration.named.is_empty() {
        let named: Vec<String> = (calibration.named.iter())
            .map(|alarm| format!("{} on joint {} ({})", alarm.name, alarm.joint, alarm.runs))
            .collect();
        let _ = write!(out, ": {}", listed(&named));
    }
    let _ = write!(
        out,
        "; {} left an unexplained residual",
        calibration.unexplained
    );
    out
}

/// The smallest size of an effect, or why there is none.
fn size(entry: &SmallestEntry) -> String {
    let Some(value) = entry.value else {
        return entry.reason.clone().unwrap_or_default();
    };
    let leading = quantity(&entry.parameter, value, &entry.unit);
    let others = entry.with.iter();
    let others = others.map(|other| quantity(&other.name, other.value, &other.unit));
    let all: Vec<String> = std::iter::once(leading).chain(others).collect();
    all.join(", ")
}

fn share(entry: &SmallestEntry) -> String {
    let share = entry.share_of_top_torque;
    share.map_or_else(|| "-".to_owned(), |share| format!("{:.2} %", 100.0 * share))
}

/// Whether an effect was named when it was hidden at that size.
fn hidden(entry: &SmallestEntry) -> String {
    let label = |other: &EffectEntry| format!("{} on joint {}", other.name, other.joint);
    let others: Vec<String> = entry.named_besides.iter().map(label).collect();
    match (entry.verified, others.is_empty()) {
        (None, _) => "not tried".to_owned(),
        (Some(true), true) => "named".to_owned(),
        (Some(true), false) => format!("named, together with {}", listed(&others)),
        (Some(false), true) => "not named".to_owned(),
        (Some(false), false) => format!("{} named in its place", listed(&others)),
    }
}

fn quantity(name: &str, value: f64, unit: &str) -> String {
    format!("{name} = {}", with_unit(small(value), unit))
}
