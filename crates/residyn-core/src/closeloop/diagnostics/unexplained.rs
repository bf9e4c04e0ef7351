use rand::Rng;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::measured_probes::measured_probes;
use super::omnibus::{Omnibus, omnibus};
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::select::{Folds, Losses, acting, gain, p_value};
use crate::data::{Joint, is_measured};
use crate::model::{Effect, FittedEffect};

/// The unexplained residual: what the residuals hold beyond noise when no effect helps any more.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Unexplained {
    /// Share of the declared model's residual variance above the sensor's noise that remains.
    #[schemars(range(min = 0))]
    pub fraction: f64,
    /// Probability of as much structure in noise alone: twice the smaller of the omnibus test's p-value and that of the
    /// probes with a noteworthy gain.
    #[schemars(range(min = 0, max = 1))]
    pub p_value: f64,
    /// The variable that most of the residual depends on: `q1`, `qd2`, `tau1`, `t`, a further measured column of the logs
    /// such as `u_temp`, products of these such as `q1*qd1`, `unknown` if it depends on none of them, `none` if it is not significant.
    #[serde(rename = "where")]
    pub place: String,
    /// The joint with the largest unexplained residual.
    pub joint: Joint,
    pub omnibus: Omnibus,
    /// Flexible shapes, which name no effect.
    pub probes: Vec<Probed>,
}

/// The result of one flexible probe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Probed {
    /// The variables that the probe depends on.
    #[serde(rename = "where")]
    pub place: String,
    pub joint: Joint,
    /// Probability, by the cluster-robust Wald test, of such a shape by chance.
    #[schemars(range(min = 0, max = 1))]
    pub p_value: f64,
    /// Fall of the loss on left-out blocks, as a share.
    #[schemars(range(max = 1))]
    pub gain: f64,
}

impl Probed {
    /// The same on another joint, under its number.
    #[must_use]
    pub(in crate::closeloop) fn on(&self, joint: Joint) -> Self {
        let renamed = |name: &str| match name.strip_suffix(&self.joint.to_string()) {
            Some(stem) if !is_measured(name) => joint.name(stem),
            _ => name.to_owned(),
        };
        let names: Vec<String> = self.place.split('*').map(renamed).collect();
        Self {
            place: names.join("*"),
            joint,
            ..self.clone()
        }
    }
}

/// The unexplained residual depends on none of the variables tested.
pub const UNKNOWN: &str = "unknown";
const NONE: &str = "none";

impl Unexplained {
    fn of(problem: &Problem<'_>, omnibus: Omnibus, probed: Vec<Probed>) -> Self {
        let asked = probed.len().max(1) as f64;
        let noteworthy = problem.settings.diagnostics.noteworthy_share;
        let seen = probed.iter().filter(|p| p.gain > noteworthy);
        let least = seen.map(|p| p.p_value).fold(1.0, f64::min);
        let (place, joint) = place(problem, &omnibus, &probed);
        Self {
            fraction: omnibus.fraction,
            p_value: (2.0 * omnibus.p_value.min(least * asked)).min(1.0),
            place,
            joint,
            omnibus,
            probes: probed,
        }
    }

    pub fn is_significant(&self) -> bool {
        self.place != NONE
    }

    /// Share of the declared model's residual variance above noise that remains, in the part that a joint is judged by.
    pub fn fraction_on(&self, problem: &Problem<'_>, joint: Joint) -> f64 {
        match problem.error_model {
            ErrorModel::OutputError => self.fraction,
            ErrorModel::InverseDynamics => self.omnibus.fractions[joint],
        }
    }

    /// Whether a significant unexplained residual lies in the part that a joint is judged by.
    pub fn matters_on(&self, problem: &Problem<'_>, joint: Joint) -> bool {
        let least = problem.settings.diagnostics.noteworthy_share;
        problem.error_model == ErrorModel::OutputError || self.omnibus.shares[joint] > least
    }
}

/// Test the residuals of the model with effects, relative to those of the declared model, with the library's probes.
pub fn diagnose(
    problem: &Problem<'_>,
    before: &Fitted,
    after: &Fitted,
    rng: &mut impl Rng,
) -> Unexplained {
    unexplained(problem, problem.library.probes(), before, after, rng)
}

/// Test whether the residuals are more than noise, whatever their shape, and probe them with flexible shapes over each
/// variable and each further measured column that all logs have. Probes name no effect; they lower the loss on left-out blocks as an unknown effect would.
pub fn unexplained(
    problem: &Problem<'_>,
    probes: &[Effect],
    before: &Fitted,
    after: &Fitted,
    rng: &mut impl Rng,
) -> Unexplained {
    let omnibus = omnibus(problem, before, after, rng);
    Unexplained::of(problem, omnibus, probed(problem, probes, after))
}

/// As [`diagnose`], with the probes of parts of the rig that were asked on their own.
pub(in crate::closeloop) fn diagnose_in_parts(
    problem: &Problem<'_>,
    before: &Fitted,
    after: &Fitted,
    probed: Vec<Probed>,
    rng: &mut impl Rng,
) -> Unexplained {
    Unexplained::of(problem, omnibus(problem, before, after, rng), probed)
}

/// What each probe of a model does.
fn probed(problem: &Problem<'_>, probes: &[Effect], after: &Fitted) -> Vec<Probed> {
    let losses = Losses::by(problem, &Folds::of(problem).alone(), after);
    let of_library = (after, acting(problem, probes));
    let of_columns = measured_probes(problem, after);
    let of_columns = of_columns
        .iter()
        .map(|(model, probes)| (model, probes.clone()));
    let asked = |(model, probes): (&Fitted, Vec<FittedEffect>)| -> Vec<Probed> {
        let probes = probes.into_par_iter();
        let ask = |probe| ask(problem, model, probe, &losses);
        probes.filter_map(ask).collect()
    };
    let all = [of_library].into_iter().chain(of_columns);
    all.flat_map(asked).collect()
}

fn ask(
    problem: &Problem<'_>,
    model: &Fitted,
    probe: FittedEffect,
    losses: &Losses,
) -> Option<Probed> {
    let (place, joint) = (variables(&probe), probe.joint);
    let effects = model.effects_and(&[probe]);
    let fitted = problem.with_effects(model, effects).ok()?;
    let with = Losses::by(problem, &Folds::of(problem).alone(), &fitted);
    Some(Probed {
        place,
        joint,
        p_value: p_value(problem, &fitted, fitted.model.effects.len() - 1)?,
        gain: gain(&losses.of_joint(joint), &with.of_joint(joint)),
    })
}

/// The variable and the joint of the probe that lowers the loss most; one test among all probes and the omnibus test.
fn place(problem: &Problem<'_>, omnibus: &Omnibus, probed: &[Probed]) -> (String, Joint) {
    let settings = &problem.settings.diagnostics;
    let noteworthy = settings.noteworthy_share;
    let level = 0.5 * settings.significance / probed.len().max(1) as f64;
    let (joint, share) = omnibus.most();
    let matters = noteworthy.max(settings.located_share * share);
    // The residual of low-passed torques near friction reversals is located by the velocity.
    let is_smoothing = |joint: Joint| {
        problem.error_model == ErrorModel::InverseDynamics
            && omnibus.fractions[joint] <= settings.unlocated_share
    };
    let stands_out = |p: &&Probed| p.p_value < level && p.gain > matters && !is_smoothing(p.joint);
    let most = probed.iter().filter(stands_out);
    let structured = omnibus.p_value < 0.5 * settings.significance
        && share > noteworthy
        && omnibus.fraction > settings.unlocated_share;
    match most.max_by(|a, b| a.gain.total_cmp(&b.gain)) {
        Some(most) => (most.place.clone(), most.joint),
        None if structured => (UNKNOWN.to_owned(), joint),
        None => (NONE.to_owned(), joint),
    }
}

/// A probe is named by its variables; those of a joint carry the joint's number.
fn variables(probe: &FittedEffect) -> String {
    let numbered = |name: &str| match name {
        of_no_joint if of_no_joint == "t" || is_measured(of_no_joint) => name.to_owned(),
        own => probe.joint.name(own),
    };
    let names: Vec<String> = probe.effect.name.split('*').map(numbered).collect();
    names.join("*")
}
