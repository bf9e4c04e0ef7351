//! Stage 7, at its end: a machine on position control, whose model was found by the torques of its drives' law, estimated
//! again by its motion under the logged commands.
//!
//! Torques are compared through a low-pass filter, which blurs every reversal and every late command alike on both sides
//! of the equation, but not quite: friction, delays and rotors come out a few percent off. Motion under the commands is
//! what the model is for, and closed loops do not diverge.

use rayon::prelude::*;

use super::error_model::ErrorModel;
use super::fit::NOTHING;
use super::fitted::Fitted;
use super::limbs::Limb;
use super::problem::Problem;
use super::refine::{Refined, with_intervals};
use crate::data::{Joint, Quantity, of_joints};
use crate::identify::{FitError, LevenbergMarquardt, Window, uncertainty};
use crate::model::Model;
use crate::sim::metric::errors_in;

/// Parts of the logs that are left out of the fit in turn.
const PARTS: usize = 2;
/// Stretches of each part: one that is slow, say, has others beside it.
const STRETCHES: usize = 4;
/// Positions in a limb's logs, of all its joints, that an estimate is made from.
const ESTIMATED: usize = 18_000;
/// Positions in a limb's logs that only have to show which of two effects they ask for.
const COMPARED: usize = 9000;
/// Joints of a limb whose motion is compared: of larger ones it takes minutes, since the lightest joint sets the steps of all.
const MOST_JOINTS: usize = 12;
/// Most steps of a fit that only has to show whether motion says more, or that an estimate in longer steps goes before: it
/// starts near its end.
const TRIAL: LevenbergMarquardt = at_most(6);
/// Most steps of an estimate, which starts near its end as well: a limb whose motion leaves it in a long valley keeps what
/// the torques say of the rest.
const ESTIMATE: LevenbergMarquardt = at_most(20);

const fn at_most(most_steps: usize) -> LevenbergMarquardt {
    LevenbergMarquardt {
        most_steps,
        // Of some thousand residuals, as few as these say nothing of an effect: they move bodies along what the logs do not
        // determine.
        enough_to_estimate: 1e-5,
        ..LevenbergMarquardt::USUAL
    }
}

impl Refined<'_> {
    /// The declared and the chosen model by motion, limb by limb, wherever a fit to motion predicts stretches of the logs
    /// that it has not seen better than a fit to torques does. Rigs whose torques are measured stay as they are.
    pub(super) fn estimate_by_motion(&mut self, limbs: &[Limb]) {
        let problem = &self.problem;
        if self.failure.is_some() {
            return;
        }
        for fitted in [&mut self.before, &mut self.after] {
            self.by_motion.clear();
            let found = limbs.par_iter().map(|limb| {
                let model = fitted.model.limb(limb.joints());
                Comparison::of(problem, limb).better(&model)
            });
            let found: Vec<Option<Model>> = found.collect();
            for (limb, found) in limbs.iter().zip(found) {
                if let Some(found) = found {
                    limb.put_into(&mut fitted.model, &found);
                    self.by_motion.push(limb.joints().to_vec());
                }
            }
        }
    }
}

impl Problem<'_> {
    /// Whether the torques that the law of drives asks for are compared.
    pub(super) fn is_by_law(&self) -> bool {
        self.error_model == ErrorModel::InverseDynamics
            && self.declared.driven_by() == Quantity::Command
    }

    /// The limbs whose motion is compared, with the training logs: none where torques are measured.
    pub(super) fn limbs_by_motion(&self) -> Vec<Limb> {
        let limbs = self.is_by_law().then(|| self.declared.limbs());
        let limbs = limbs.into_iter().flatten();
        let limbs = limbs.filter(|joints| joints.len() <= MOST_JOINTS);
        limbs.map(|joints| Limb::of(self, &[], joints)).collect()
    }
}

/// A limb's logs, compared by motion and by the torques that the law of its drives asks for.
pub(super) struct Comparison<'l> {
    motion: Problem<'l>,
    /// The same with friction that reverses as slowly as in the torques, so that steps may be longer.
    trial: Problem<'l>,
    torques: Problem<'l>,
}

impl<'l> Comparison<'l> {
    pub fn of(whole: &Problem<'l>, limb: &'l Limb) -> Self {
        let widths = of_joints(&whole.smoothing_velocities, limb.joints());
        let problem = |errors| Problem {
            held: whole.held.clone(),
            solver: &ESTIMATE,
            ..limb.problem(whole, &NOTHING, errors)
        };
        let rows = ESTIMATED / limb.joints().len();
        let (motion, torques) = (
            problem(ErrorModel::OutputError).spread_over(rows),
            problem(ErrorModel::InverseDynamics).spread_over(rows),
        );
        let (windows, noise) = (
            torques.shooting.windows.clone(),
            of_joints(&whole.shooting.noise, limb.joints()),
        );
        let shooting = torques
            .error_model
            .shooting(torques.logs, windows, &noise, &widths);
        Self {
            trial: Problem {
                solver: &TRIAL,
                ..motion.with_smoothing_velocities(widths.clone())
            },
            torques: torques
                .with_smoothing_velocities(widths)
                .over(shooting.near(torques.declared)),
            motion,
        }
    }

    /// The motion in fine steps, for a fit that begins near its end.
    pub fn fine(&self, model: &Model) -> Problem<'l> {
        Problem {
            solver: &TRIAL,
            ..stable(&self.motion, model).refined()
        }
    }

    /// A part of the motion, for fits that end after a few steps.
    pub fn short(&self, model: &Model) -> Problem<'l> {
        Problem {
            solver: &TRIAL,
            ..with_bodies_held(&self.motion.spread_over(COMPARED / model.joints), model)
        }
    }

    /// The model by motion, with intervals, if the parts of the logs together say that motion predicts them better.
    fn better(&self, model: &Model) -> Option<Model> {
        let trial = stable(&self.trial, model);
        let gains = (0..PARTS).into_par_iter();
        let gains: Vec<f64> = gains.map(|part| self.gain(&trial, model, part)).collect();
        if gains.iter().sum::<f64>() <= 0.0 {
            return None;
        }
        let coarse = estimate(&with_bodies_held(&self.motion, model), model).ok()?;
        let fine = self.fine(model);
        let found = estimate(&fine, &coarse.model).ok()?;
        let uncertainty = uncertainty(&fine.shooting, &found.fit);
        Some(with_intervals(&fine, &found, &uncertainty, &coarse.model))
    }

    /// By how much motion is the better guide to a part that is left out: the logarithm of the ratio of the errors.
    fn gain(&self, trial: &Problem<'l>, model: &Model, part: usize) -> f64 {
        let (left_out, kept) = parted(&trial.shooting.windows, part);
        let error = |guide: &Problem<'l>, start: &Model| {
            let kept = guide.over(guide.shooting.over(kept.clone()));
            let fitted = estimate(&kept, start).ok()?;
            Some((squares(trial, &fitted.model, &left_out), fitted.model))
        };
        let Some((by_torques, model)) = error(&self.torques, model) else {
            return 0.0;
        };
        error(trial, &model).map_or(0.0, |(by_motion, _)| log_ratio(&by_torques, &by_motion))
    }
}

/// The same problem in stable steps, with bodies as the torques have them: free, they are most of a limb's values and of the
/// time, and change little.
fn with_bodies_held<'l>(problem: &Problem<'l>, model: &Model) -> Problem<'l> {
    let bodies = model.inertias().into_iter().flatten();
    Problem {
        held: problem.held.iter().copied().chain(bodies).collect(),
        ..stable(problem, model)
    }
}

/// The same problem in steps in which the friction of a model is stable.
fn stable<'l>(problem: &Problem<'l>, model: &Model) -> Problem<'l> {
    (problem.in_stable_steps(model)).unwrap_or_else(|| problem.clone())
}

/// The windows of a part of the logs, and the others.
fn parted(windows: &[Window], part: usize) -> (Vec<Window>, Vec<Window>) {
    let stretch = |k: usize| k * PARTS * STRETCHES / windows.len();
    let (own, others): (Vec<_>, Vec<_>) =
        (windows.iter().enumerate()).partition(|(k, _)| stretch(*k) % PARTS == part);
    let windows = |of: Vec<(usize, &Window)>| of.into_iter().map(|(_, window)| *window).collect();
    (windows(own), windows(others))
}

pub(super) fn estimate(problem: &Problem<'_>, model: &Model) -> Result<Fitted, FitError> {
    let start_states = problem.shooting.initial_start_states(0);
    problem.refit(model, start_states, None)
}

/// The loss of the motion under the commands, after a short fit of a model to it.
pub(super) fn loss_of_motion(problem: &Problem<'_>, model: &Model) -> Option<f64> {
    fitted_to_motion(problem, model, |_, fitted| fitted.loss())
}

/// Sums of the squared position errors under the commands, one per joint, after a short fit of a model to the motion.
pub(super) fn squares_of_motion(problem: &Problem<'_>, model: &Model) -> Option<Vec<f64>> {
    fitted_to_motion(problem, model, |trial, fitted| {
        squares(trial, &fitted.model, &trial.shooting.windows)
    })
}

fn fitted_to_motion<T>(
    problem: &Problem<'_>,
    model: &Model,
    of: impl Fn(&Problem<'_>, &Fitted) -> T,
) -> Option<T> {
    let limb = Limb::of(problem, &[], Joint::all(problem.declared.joints).collect());
    let trial = Comparison::of(problem, &limb).short(model);
    let fitted = estimate(&trial, model).ok()?;
    Some(of(&trial, &fitted))
}

/// Sums of the squared position errors in these windows, one per joint.
fn squares(problem: &Problem<'_>, model: &Model, windows: &[Window]) -> Vec<f64> {
    let (dynamics, steps) = (model.dynamics(), problem.shooting.steps());
    let errors = errors_in(&dynamics, problem.logs, windows, steps);
    let of_joint = |j: usize| errors.iter().map(|error| error.position[j]).sum();
    (0..model.joints).map(of_joint).collect()
}

/// The logarithm of the ratios of two such sums, on average: joints count alike, however far they move.
pub(super) fn log_ratio(own: &[f64], other: &[f64]) -> f64 {
    let of_joint = |(own, other): (&f64, &f64)| (own / other).ln();
    own.iter().zip(other).map(of_joint).sum::<f64>() / own.len() as f64
}
