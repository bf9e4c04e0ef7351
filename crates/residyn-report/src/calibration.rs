//! What the logs could show, as a part of `report.json`, a section of `report.md` and a line for a terminal.

use std::collections::BTreeMap;
use std::fmt::Write;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::wording::{listed, small};
use residyn_core::closeloop::{Calibration, DetectionLimit, Named, Smallest};
use residyn_core::data::Joint;
use residyn_core::digits::with_unit;
use residyn_core::model::EffectParameter;

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct CalibrationEntry {
    /// simulations of the accepted model that were searched like the logs
    #[schemars(range(min = 1))]
    runs: usize,
    /// runs in which an absent effect was named
    alarms: usize,
    /// alarms / runs
    #[schemars(range(min = 0, max = 1))]
    rate: f64,
    rate_ci95: [f64; 2],
    /// the effects named by false alarm, and in how many runs
    named: Vec<AlarmEntry>,
    /// runs that left a residual that nothing explains
    unexplained: usize,
    /// effects were hidden in a simulation at this multiple of their smallest size
    hidden_at: f64,
    /// for each effect that the accepted model lacks, the smallest size that the search would name in four of five such
    /// logs
    pub smallest: Vec<SmallestEntry>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct AlarmEntry {
    name: String,
    joint: Joint,
    #[schemars(range(min = 1))]
    runs: usize,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct SmallestEntry {
    effect: String,
    /// its name for people
    pub title: String,
    pub joint: Joint,
    parameter: String,
    /// null if there is none; reason says why
    value: Option<f64>,
    unit: String,
    reason: Option<String>,
    /// value / highest torque of the joint, where the parameter is a torque
    share_of_top_torque: Option<f64>,
    /// the effect's inner parameters at that size; other levels and slopes are at zero
    with: Vec<ValueEntry>,
    /// whether it was named when hidden in a simulation at 1.5 times that size; null where that was not tried
    verified: Option<bool>,
    /// effects that were named in addition
    named_besides: Vec<EffectEntry>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct ValueEntry {
    name: String,
    value: f64,
    unit: String,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct EffectEntry {
    name: String,
    joint: Joint,
}

impl CalibrationEntry {
    pub(super) fn new(calibration: &Calibration) -> Self {
        Self {
            runs: calibration.named.len(),
            alarms: calibration.alarms(),
            rate: calibration.rate(),
            rate_ci95: calibration.rate_ci95(),
            named: false_names(calibration),
            unexplained: calibration.unexplained,
            hidden_at: calibration.hidden,
            smallest: calibration
                .limits
                .iter()
                .map(|limit| smallest(limit, &calibration.top_torque))
                .collect(),
        }
    }
}

fn false_names(calibration: &Calibration) -> Vec<AlarmEntry> {
    let mut runs: BTreeMap<(&str, Joint), usize> = BTreeMap::new();
    for effect in calibration.named.iter().flatten() {
        *runs.entry((&effect.name, effect.joint)).or_default() += 1;
    }
    runs.into_iter()
        .map(|((name, joint), runs)| AlarmEntry {
            name: name.to_owned(),
            joint,
            runs,
        })
        .collect()
}

fn smallest(limit: &DetectionLimit, top_torque: &[f64]) -> SmallestEntry {
    let effect = &limit.effect;
    let parameters = &effect.effect.parameters;
    let (leading, values) = match &limit.smallest {
        Smallest::Detectable { switch, values } => (*switch, values.as_slice()),
        // The parameter that would give its size.
        _ => (
            parameters.iter().position(|p| p.is_switch()).unwrap_or(0),
            [].as_slice(),
        ),
    };
    let EffectParameter { name, unit, .. } = &parameters[leading];
    let value = values.get(leading).copied();
    let top = top_torque[effect.joint];
    let inner = parameters
        .iter()
        .zip(values)
        .filter(|(p, _)| !p.is_switch());
    SmallestEntry {
        effect: effect.effect.name.clone(),
        title: effect.title(),
        joint: effect.joint,
        parameter: name.clone(),
        value,
        unit: unit.clone(),
        reason: reason(&limit.smallest).map(str::to_owned),
        share_of_top_torque: value
            .filter(|_| unit == "N m" && top > 0.0)
            .map(|value| value / top),
        with: inner
            .map(|(parameter, value)| ValueEntry {
                name: parameter.name.clone(),
                value: *value,
                unit: parameter.unit.clone(),
            })
            .collect(),
        verified: limit.verified(),
        named_besides: besides(limit)
            .map(|other| EffectEntry {
                name: other.name.clone(),
                joint: other.joint,
            })
            .collect(),
    }
}

fn reason(size: &Smallest) -> Option<&'static str> {
    match size {
        Smallest::Detectable { .. } => None,
        Smallest::Indistinguishable => {
            Some("indistinguishable from the rest of the model at any size")
        }
        Smallest::Diverged => Some("not computed: the model diverges with it"),
        Smallest::NotComputed => Some("not computed: no parameter value switches the effect off"),
    }
}

/// Effects named in addition to the hidden one, or in its place.
fn besides(limit: &DetectionLimit) -> impl Iterator<Item = &Named> {
    let hidden = Named::of(&limit.effect);
    let named = limit.named.iter().flatten();
    named.filter(move |named| **named != hidden)
}

/// The section of `report.md`.
pub(super) fn section(calibration: &CalibrationEntry) -> String {
    let mut out = format!(
        "## What these logs could show\n\n{} {}.\n\n{}\n\n\
         | effect | joint | smallest size | share of the top torque | hidden in a simulation |\n|---|---|---|---|---|\n",
        simulations(calibration),
        alarms(calibration),
        limits(calibration),
    );
    for entry in &calibration.smallest {
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} |",
            entry.title,
            entry.joint,
            size(entry),
            share(entry),
            hidden(entry)
        );
    }
    out + "\n"
}

/// The line for a terminal.
pub(super) fn line(calibration: &CalibrationEntry) -> String {
    format!(
        "{} simulations of the accepted model: {}",
        calibration.runs,
        alarms(calibration)
    )
}

/// What was searched, in a sentence.
pub(super) fn simulations(calibration: &CalibrationEntry) -> String {
    format!(
        "{} simulations of the accepted model were searched like the logs themselves, driven by the torques of the training \
         logs and with the residuals of the fit as noise.",
        calibration.runs
    )
}

/// How often an absent effect was named.
pub(super) fn alarms(calibration: &CalibrationEntry) -> String {
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

/// What the table of smallest sizes gives.
pub(super) fn limits(calibration: &CalibrationEntry) -> String {
    format!(
        "The table gives the smallest size at which the search would name each effect in four of five such sets of logs. As a \
         check, common effects were hidden in a simulation at {} times that size.",
        calibration.hidden_at
    )
}

/// The smallest size of an effect, or why there is none.
pub(super) fn size(entry: &SmallestEntry) -> String {
    let Some(value) = entry.value else {
        return entry.reason.clone().unwrap_or_default();
    };
    let leading = quantity(&entry.parameter, value, &entry.unit);
    let others = entry.with.iter();
    let others = others.map(|other| quantity(&other.name, other.value, &other.unit));
    let all: Vec<String> = std::iter::once(leading).chain(others).collect();
    all.join(", ")
}

pub(super) fn share(entry: &SmallestEntry) -> String {
    let share = entry.share_of_top_torque;
    share.map_or_else(|| "-".to_owned(), |share| format!("{:.2} %", 100.0 * share))
}

/// Whether an effect was named when it was hidden at that size.
pub(super) fn hidden(entry: &SmallestEntry) -> String {
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
