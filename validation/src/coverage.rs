//! Whether intervals contain the true values.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use super::hidden::Label;
use super::judge::{Estimate, Truth};

/// Whether a 95 % interval holds the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    pub name: String,
    pub truth: f64,
    pub value: f64,
    pub covered: bool,
}

/// Which intervals of these effects and of declared parameters hold the truth. Intervals are meaningful only for the
/// true structure.
pub fn coverage(
    truth: &Truth,
    effects: &[(Label, Vec<Estimate>)],
    declared: &[Estimate],
) -> Vec<Coverage> {
    let mut all = Vec::new();
    for (label, values) in &truth.effects {
        for (_, estimates) in effects.iter().filter(|(of, _)| of == label) {
            let mut estimates = estimates.clone();
            if label.starts_with("cogging_torque") {
                turn_ripple(&mut estimates, values);
            }
            all.extend(estimates.iter().filter_map(|estimate| {
                let truth = *values.get(&estimate.name)?;
                Coverage::of(&format!("{label}.{}", estimate.name), truth, estimate)
            }));
        }
    }
    all.extend(declared.iter().filter_map(|estimate| {
        let truth = *truth.declared.get(&estimate.name)?;
        Coverage::of(&estimate.name, truth, estimate)
    }));
    all
}

/// A ripple stays the same if its amplitude changes sign and its phase advances by half a turn, or by any whole number
/// of turns: this picks the form of the truth.
fn turn_ripple(estimates: &mut [Estimate], truth: &BTreeMap<String, f64>) {
    let amplitude = estimates.iter().find(|e| e.name == "A");
    let flipped = amplitude.is_some_and(|e| e.value * truth["A"] < 0.0);
    for estimate in estimates {
        if flipped && estimate.name == "A" {
            estimate.value = -estimate.value;
            estimate.ci95 = estimate.ci95.map(|[low, high]| [-high, -low]);
        }
        if estimate.name == "phase" {
            let half_turn = if flipped { PI } else { 0.0 };
            let off = estimate.value + half_turn - truth["phase"];
            let turn = half_turn - TAU * (off / TAU).round();
            estimate.value += turn;
            estimate.ci95 = estimate.ci95.map(|[low, high]| [low + turn, high + turn]);
        }
    }
}

impl Coverage {
    /// `None` without an interval.
    fn of(name: &str, truth: f64, estimate: &Estimate) -> Option<Self> {
        let [low, high] = estimate.ci95?;
        Some(Self {
            name: name.to_owned(),
            truth,
            value: estimate.value,
            covered: (low..=high).contains(&truth),
        })
    }
}
