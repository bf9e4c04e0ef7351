//! Stage 7: estimate the declared and the chosen model in fine steps.

use std::sync::Arc;

use super::error_model::ErrorModel;
use super::fitted::Fitted;
use super::judge::Found;
use super::problem::Problem;
use super::select::p_value_by;
use super::stage::{Stage, Watch};
use crate::data::Joint;
use crate::identify::{
    FitError, Identifiability, IdentifiableBodies, Uncertainty, Values, identifiable_bodies,
    uncertainty,
};
use crate::model::Model;

/// The declared and the chosen model, both estimated in the same steps: in fine ones or, if either estimate failed, in
/// those that effects were selected with. Their errors differ by the effects alone.
pub struct Refined<'a> {
    /// The training logs in these steps.
    pub problem: Problem<'a>,
    /// The declared model.
    pub before: Fitted,
    /// The chosen model, with 95 % intervals.
    pub after: Fitted,
    /// What the logs determine.
    pub identifiability: Identifiability,
    /// What the logs determine of a chain's bodies, if torques were compared.
    pub bodies: IdentifiableBodies,
    /// How well the fit of the chosen model determines its values.
    pub uncertainty: Uncertainty,
    /// Why the steps are not fine, if they are not.
    pub failure: Option<FitError>,
    /// The limbs whose motion told more than the torques, by which the rest was estimated.
    pub by_motion: Vec<Vec<Joint>>,
}

/// Estimate the declared and the chosen model in fine steps or, for torques, with the noise that the chosen model
/// leaves.
pub fn refine<'a>(found: &Found<'a>, watch: &dyn Watch) -> Refined<'a> {
    watch.see(Stage::Refine.into());
    refined(&found.problem, &found.before, &found.chosen.after)
}

/// The same for any two models.
pub(super) fn refined<'a>(
    problem: &Problem<'a>,
    declared: &Fitted,
    chosen: &Fitted,
) -> Refined<'a> {
    let mut fine = problem.finer(chosen);
    let mut identifiability = problem.identifiability.clone();
    let (problem, before, mut after, failure) = loop {
        match rayon::join(|| fine.estimate(declared), || fine.estimate(chosen)) {
            (Ok(before), Ok(after)) => {
                // A value that rests on a single block is not determined: another block might give another value.
                let Some(open) = fine.open_in(&after) else {
                    break (fine, before, after, None);
                };
                fine.held.push(open.hold);
                identifiability.leave(open);
            }
            (Err(error), _) | (_, Err(error)) => {
                let (before, after) = (declared.clone(), chosen.clone());
                break (problem.clone(), before, after, Some(error));
            }
        }
    };
    let uncertainty = uncertainty(&problem.shooting, &after.fit);
    let bodies = problem.identifiable_bodies(&after, &uncertainty);
    after.model = with_intervals(&problem, &after, &uncertainty, &chosen.model);
    Refined {
        bodies,
        uncertainty,
        problem,
        before,
        after,
        identifiability,
        failure,
        by_motion: Vec::new(),
    }
}

impl Refined<'_> {
    /// Probability of the values of the k-th effect of the chosen model if it were absent, see [`p_value_by`].
    pub(super) fn p_value(&self, k: usize) -> Option<f64> {
        p_value_by(&self.uncertainty, &self.problem, &self.after, k)
    }
}

impl<'a> Problem<'a> {
    /// The same problem in fine steps or, for torques, with the noise that a model leaves.
    pub(super) fn finer(&self, fitted: &Fitted) -> Self {
        match self.error_model {
            ErrorModel::OutputError => self.refined(),
            ErrorModel::InverseDynamics => self.weighed_by(fitted),
        }
    }

    /// The same problem in finer steps, to estimate a model that has been chosen. Smoothing velocities that the model
    /// file gives stay, and so do parameters that the logs do not determine: the intervals of the others are relative
    /// to them.
    pub fn refined(&self) -> Self {
        let settings = &self.settings.refine;
        let steps = self.shooting.steps();
        let (step_s, narrower) = (settings.step_s, settings.smoothing_velocity_factor);
        let given = self.declared.smoothing_velocity.as_ref();
        let narrower = given.map_or(narrower, |_| 1.0);
        let usual = self.settings.fit.smoothing_velocity_share;
        // A width above the usual one is that over which the rig's friction reverses.
        let of_joint = |(width, top): (&f64, &f64)| match *width > usual * top {
            true => *width,
            false => narrower * width,
        };
        let widths = self.smoothing_velocities.iter().zip(&self.top_speed);
        let smoothing_velocities: Vec<f64> = widths.map(of_joint).collect();
        Self {
            smoothing_velocities,
            held: self.identifiability.hold.clone(),
            usual: Arc::default(),
            shooting: self
                .shooting
                .clone()
                .in_steps(steps.at_most(step_s.min(narrower * steps.longest_s))),
            ..self.clone()
        }
    }

    /// The same problem with each joint's noise as a model leaves it.
    fn weighed_by(&self, fitted: &Fitted) -> Self {
        let dynamics = self.compiled(&fitted.model);
        let values = Values::of(&dynamics, self.logs);
        let noise = (self.shooting).left_by(&dynamics, &values, &fitted.fit.start_states);
        self.over(self.shooting.with_noise(&noise))
    }
}

impl Problem<'_> {
    /// What the logs determine of a chain's bodies.
    fn identifiable_bodies(
        &self,
        fitted: &Fitted,
        uncertainty: &Uncertainty,
    ) -> IdentifiableBodies {
        if self.error_model == ErrorModel::OutputError {
            return IdentifiableBodies::default();
        }
        let dynamics = self.compiled(&fitted.model);
        let values = Values::of(&dynamics, self.logs);
        identifiable_bodies(&dynamics, self.declared, &values, &fitted.fit, uncertainty)
    }
}

/// A fitted model with its 95 % intervals; parameters that were not free have none. Each interval is widened by the
/// change from the `coarse` value: smoothing and steps err to first order, so the change on halving them equals the
/// error that is left (Richardson 1911).
pub fn with_intervals(
    problem: &Problem<'_>,
    fitted: &Fitted,
    uncertainty: &Uncertainty,
    coarse: &Model,
) -> Model {
    let (values, coarse) = (fitted.model.values(), coarse.values());
    let mut model = fitted.model.clone();
    for (i, column) in fitted.fit.columns.iter().enumerate() {
        let k = column.parameter;
        let log = column.log.map(|log| &problem.logs[log]);
        let off = match log {
            Some(_) => 0.0,
            None => (values[k] - coarse[k]).abs(),
        };
        model.set_half_width(k, log, uncertainty.half_width(i) + off);
    }
    model
}
