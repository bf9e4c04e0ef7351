use super::learn::Learned;
use super::residual::ForceSample;
use super::select::{Evidence, Round};
use super::split::How;
use super::study::Fitted;
use super::unexplained::Unexplained;
use crate::data::{Audit, Log};
use crate::evaluate::Assessment;
use crate::identify::Identifiability;
use crate::model::{FittedEffect, Parameter};

/// The answer in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Effects were found and nothing significant is left.
    Explained,
    /// Effects were found and something significant is left.
    PartlyExplained,
    /// Something significant is missing and no effect of the library names it.
    Unexplained,
    /// The declared model explains the logs.
    NoMissingEffect,
    /// The logs are too few or too poor to tell.
    Inconclusive,
}

/// Everything that closing the loop found out.
pub struct Outcome {
    pub verdict: Verdict,
    /// Why, in a sentence.
    pub reason: String,
    pub how_split: How,
    pub train: Vec<Log>,
    pub test: Vec<Log>,
    pub audits: Vec<Audit>,
    pub identifiability: Identifiability,
    pub before: Fitted,
    pub after: Fitted,
    /// All parameters of `after`, with their intervals.
    pub parameters: Vec<Parameter>,
    pub findings: Vec<Finding>,
    pub rounds: Vec<Round>,
    pub alternatives: Vec<Alternative>,
    pub unexplained: Unexplained,
    pub errors: Errors,
    /// Residual generalised force along the training logs, by the model before and after.
    pub residual_before: Vec<ForceSample>,
    pub residual_after: Vec<ForceSample>,
    /// The residual network trained on what is left, where the logs give enough to train it.
    pub learned: Option<Learned>,
    /// For each joint whether it slides rather than turns.
    pub prismatic: Vec<bool>,
    /// Widths of the smoothed sign of each joint, in rad/s (or m/s).
    pub sign_widths: Vec<f64>,
}

/// One effect that was added.
#[derive(Debug, Clone)]
pub struct Finding {
    pub effect: FittedEffect,
    pub expression: String,
    /// With intervals.
    pub parameters: Vec<Parameter>,
    pub p_value: f64,
    /// Share of the position error that this effect alone takes away, by a refit without it.
    pub error_reduction: f64,
}

/// Another explanation that the logs do not tell from the one reported.
#[derive(Debug, Clone)]
pub struct Alternative {
    pub effect: FittedEffect,
    pub reason: String,
    pub experiment: String,
}

/// Open-loop errors on the test logs.
pub struct Errors {
    pub before: Assessment,
    pub after: Assessment,
    pub hybrid: Option<Assessment>,
    /// 95 % interval of the relative reduction of the position error, before to after.
    pub reduction_ci95: Option<[f64; 2]>,
}

impl Alternative {
    /// The candidates that did as well as the one that a round chose, unless they are in the final model
    /// themselves; what the latest round says of one holds.
    pub(super) fn of_rounds(rounds: &[Round], model: &Fitted) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for alternative in rounds.iter().flat_map(Self::of_round) {
            let same = |e: &FittedEffect| {
                e.joint == alternative.effect.joint
                    && e.effect.name == alternative.effect.effect.name
            };
            all.retain(|other| !same(&other.effect));
            if !model.effects.iter().any(same) {
                all.push(alternative);
            }
        }
        all
    }

    fn of_round(round: &Round) -> Vec<Self> {
        let Some(chosen) = round.chosen.map(|i| &round.evidence[i]) else {
            return Vec::new();
        };
        let others = round.evidence.iter().filter(|e| !std::ptr::eq(*e, chosen));
        others
            .filter(|e| e.is_as_good_as(chosen))
            .map(|e| Self::to(chosen, e))
            .collect()
    }

    fn to(chosen: &Evidence, other: &Evidence) -> Self {
        let name = format!(
            "{} on joint {}",
            chosen.effect.effect.name,
            chosen.effect.joint + 1
        );
        let contains = other
            .effect
            .effect
            .contains
            .contains(&chosen.effect.effect.name)
            && other.effect.joint == chosen.effect.joint;
        let reason = if contains {
            format!("contains {name} and explains these logs no better")
        } else {
            format!(
                "not separable on these logs: when {name} was added for cutting the left-out loss by {:.0} %, \
                 this would have cut it by {:.0} %",
                100.0 * chosen.gain,
                100.0 * other.gain
            )
        };
        Self {
            effect: other.effect.clone(),
            reason,
            experiment: other.effect.effect.shown_by.clone(),
        }
    }
}
