//! What the logs could show, as a part of `report.json`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use residyn_core::closeloop::{Calibration, DetectionLimit, Named, Smallest};
use residyn_core::data::Joint;
use residyn_core::model::EffectParameter;

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct CalibrationEntry {
    /// simulations of the accepted model that were searched like the logs
    #[schemars(range(min = 1))]
    pub runs: usize,
    /// runs in which an absent effect was named
    pub alarms: usize,
    /// alarms / runs
    #[schemars(range(min = 0, max = 1))]
    pub rate: f64,
    pub rate_ci95: [f64; 2],
    /// the effects named by false alarm, and in how many runs
    pub named: Vec<AlarmEntry>,
    /// runs that left a residual that nothing explains
    pub unexplained: usize,
    /// effects were hidden in a simulation at this multiple of their smallest size
    pub hidden_at: f64,
    /// for each effect that the accepted model lacks, the smallest size that the search would name in four of five such
    /// logs
    pub smallest: Vec<SmallestEntry>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct AlarmEntry {
    pub name: String,
    pub joint: Joint,
    #[schemars(range(min = 1))]
    pub runs: usize,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct SmallestEntry {
    pub effect: String,
    /// its name for people
    pub title: String,
    pub joint: Joint,
    pub parameter: String,
    /// null if there is none; reason says why
    pub value: Option<f64>,
    pub unit: String,
    pub reason: Option<String>,
    /// value / highest torque of the joint, where the parameter is a torque
    pub share_of_top_torque: Option<f64>,
    /// the effect's inner parameters at that size; other levels and slopes are at zero
    pub with: Vec<ValueEntry>,
    /// whether it was named when hidden in a simulation at 1.5 times that size; null where that was not tried
    pub verified: Option<bool>,
    /// effects that were named in addition
    pub named_besides: Vec<EffectEntry>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct ValueEntry {
    pub name: String,
    pub value: f64,
    pub unit: String,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct EffectEntry {
    pub name: String,
    pub joint: Joint,
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
