use super::calibrate::Calibration;
use super::confirm::TakenBack;
use super::contradicted::Contradicted;
use super::curve::Curve;
use super::experiment::{Separation, separation};
use super::learn::Learned;
use super::proposal::Proposal;
use super::residual::ForceSample;
use super::search::{Rival, Round};
use super::split::How;
use super::study::{Fitted, Study};
use super::unexplained::Unexplained;
use crate::data::{Audit, Log};
use crate::evaluate::Assessment;
use crate::identify::Identifiability;
use crate::model::{FittedEffect, OwnValue, Parameter, System};

/// The answer in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
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
    /// Values in the model file that the fit of `after` contradicts.
    pub contradicted: Vec<Contradicted>,
    /// All parameters of `after`, with their intervals.
    pub parameters: Vec<Parameter>,
    pub findings: Vec<Finding>,
    pub rounds: Vec<Round>,
    pub alternatives: Vec<Alternative>,
    pub taken_back: Vec<TakenBack>,
    /// Stretches of data set aside that the effects were confirmed on; 0 where the logs leave none.
    pub confirmed_on: usize,
    pub unexplained: Unexplained,
    /// A formula for what is left, where something that matters is.
    pub proposal: Option<Proposal>,
    pub errors: Errors,
    /// Residual generalised force along the training logs, by the model before and after; angles within
    /// the turn where a joint makes more than one.
    pub residual_before: Vec<ForceSample>,
    pub residual_after: Vec<ForceSample>,
    /// The same as smooth curves over each variable.
    pub curves_before: Vec<Curve>,
    pub curves_after: Vec<Curve>,
    /// The residual network trained on what is left, where the logs give enough to train it.
    pub learned: Option<Learned>,
    /// What the training logs could show, where that was asked for: see [`super::calibrate`].
    pub calibration: Option<Calibration>,
    /// For each joint whether it slides rather than turns.
    pub prismatic: Vec<bool>,
    /// Widths of the smoothed sign of each joint, in rad/s (or m/s).
    pub sign_widths: Vec<f64>,
}

impl Outcome {
    /// The training logs as they were studied; `system` is the one that was declared.
    pub fn study<'a>(&'a self, system: &'a System) -> Study<'a> {
        Study {
            identifiability: self.identifiability.clone(),
            ..Study::new(system, &self.train)
        }
    }
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

impl Finding {
    /// What it says of each parameter: its value or, where it has one per log, its values in single logs.
    pub fn rows(&self) -> Vec<(Parameter, Option<&OwnValue>)> {
        let of_parameter = |(k, parameter): (usize, &Parameter)| {
            if !parameter.per_log {
                return vec![(parameter.clone(), None)];
            }
            let own = self.effect.own.iter().filter(|own| own.parameter == k);
            own.map(|own| {
                let parameter = Parameter {
                    value: own.value,
                    ci95: own.ci95,
                    ..parameter.clone()
                };
                (parameter, Some(own))
            })
            .collect()
        };
        let all = self.parameters.iter().enumerate();
        all.flat_map(of_parameter).collect()
    }
}

/// Another explanation that the logs do not tell from the one reported.
#[derive(Debug, Clone)]
pub struct Alternative {
    /// The whole set of effects.
    pub effects: Vec<FittedEffect>,
    /// The one of them that the set reported does not have.
    pub effect: FittedEffect,
    pub reason: String,
    /// What would tell it from the one reported; simulated for the few best alternatives.
    pub separation: Option<Separation>,
}

/// Experiments are simulated for so many alternatives, the best ones: each costs as much as a few fits.
const SIMULATED: usize = 3;

/// A model that is scored as it is, beside those that are fitted.
#[derive(Debug, Clone)]
pub struct Contender {
    /// As the user calls it.
    pub name: String,
    /// With the same joints as the declared model.
    pub system: System,
}

/// Open-loop errors on the test logs.
pub struct Errors {
    /// The declared model with the values in its file, before any fit.
    pub declared: Assessment,
    pub before: Assessment,
    pub after: Assessment,
    pub hybrid: Option<Assessment>,
    /// Other models as they are, by name.
    pub against: Vec<(String, Assessment)>,
    /// 95 % interval of the relative reduction of the position error, before to after.
    pub reduction_ci95: Option<[f64; 2]>,
}

impl Alternative {
    /// The sets of effects that do as well as the one that stood; those of which a part was taken back are none.
    /// `progress` is told what is being simulated.
    pub(super) fn of_rivals(
        study: &Study<'_>,
        rivals: Vec<Rival>,
        model: &Fitted,
        progress: &mut dyn FnMut(&str),
    ) -> Vec<Self> {
        let stands = |effect: &FittedEffect| {
            let same = |other: &FittedEffect| other.label() == effect.label();
            model.effects.iter().any(same)
        };
        let mut rivals: Vec<Rival> = rivals
            .into_iter()
            .filter(|rival| stands(&rival.instead_of))
            .collect();
        rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let mut all: Vec<Self> = Vec::new();
        for rival in rivals {
            let separation = (all.len() < SIMULATED).then(|| {
                progress(&format!("simulating what tells {}", rival.effect.label()));
                separation(study, model, &rival)
            });
            all.push(Self::of(rival, separation.flatten()));
        }
        all
    }

    fn of(rival: Rival, separation: Option<Separation>) -> Self {
        let chosen = rival.instead_of.label();
        let reason = if rival.contains_chosen() {
            format!("contains {chosen} and explains these logs no better")
        } else {
            format!(
                "not separable from {chosen} on these logs: beside the other effects it cuts the left-out loss by {:.1} %, \
                 that one by {:.1} %",
                100.0 * rival.gain,
                100.0 * rival.gain_of_chosen
            )
        };
        Self {
            effects: rival.model.effects,
            effect: rival.effect,
            reason,
            separation,
        }
    }

    /// The experiment that tells, in a sentence.
    pub fn experiment(&self) -> String {
        self.separation.as_ref().map_or_else(
            || "not simulated: others do as well and come first".to_owned(),
            Separation::text,
        )
    }
}
