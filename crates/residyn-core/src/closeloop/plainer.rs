//! Stage 4, at its end: whether logs that a fit has not seen are predicted better without the effects that were chosen.

use rayon::prelude::*;

use super::error_model::ErrorModel;
use super::establish::{Chosen, Standing};
use super::every_log::SetApart;
use super::fitted::Fitted;
use super::problem::Problem;
use crate::data::Log;
use crate::identify::Values;
use crate::model::FittedEffect;
use crate::sim::metric::{errors_in, windows};

/// Most groups of logs that are left out in turn.
const GROUPS: usize = 4;

/// A plainer model that takes the place of the chosen one.
pub(super) struct Plainer {
    pub fitted: Fitted,
    pub unused: Unused,
}

impl Plainer {
    /// The model without an effect that is not established.
    fn without(standing: &Standing) -> Option<Self> {
        Some(Self {
            fitted: standing.without.clone().ok()?,
            unused: Unused {
                effect: Some(standing.effect.clone()),
                why: standing.reason.clone()?,
            },
        })
    }
}

/// What a plainer model does not use, and why.
#[derive(Debug, Clone)]
pub struct Unused {
    /// One effect, or all that the search found.
    pub(super) effect: Option<FittedEffect>,
    /// The end of a sentence.
    pub(super) why: String,
}

impl Unused {
    /// As a sentence.
    pub fn text(&self) -> String {
        let why = &self.why;
        match &self.effect {
            Some(effect) => format!("{} is not used: {why}", effect.label()),
            None => format!("the effects that the search found are not used: {why}"),
        }
    }
}

/// The model without a transmission that is not established; or the one without one of the chosen effects, with the usual
/// friction, with the effects that most machines have, or the declared one, if it predicts whole logs better than the chosen
/// one: those left out of a fit of the others in turn, and those set `apart`, to which nothing is fitted. The search compares
/// short windows of logs that it knows. Or the one without an effect that does nothing, if there is none of these.
pub(super) fn plainer(
    problem: &Problem<'_>,
    declared: &Fitted,
    chosen: &Chosen,
    apart: &[Log],
) -> Option<Plainer> {
    let after = &chosen.after;
    if problem.added(&after.model).is_empty() {
        return None;
    }
    if is_harmful(problem, declared, after, apart) {
        return Some(Plainer {
            fitted: declared.clone(),
            unused: Unused {
                effect: None,
                why: "they raise the error on the logs set apart".into(),
            },
        });
    }
    if let Some(body) = doubtful_body(chosen) {
        return Plainer::without(body);
    }
    let settings = &problem.settings.select;
    let least = LeftOut::of(problem, after, apart);
    // A whole model that took the place of the chosen one and then lost an idle effect must not return with it.
    let is_first = (chosen.unused.iter()).all(|unused| unused.effect.is_some());
    let is_new = |other: &&Fitted| is_first && !has_same_effects(other, after);
    let friction = problem.with_usual_friction();
    let friction = friction.as_ref().filter(is_new);
    let usual = chosen.usual.as_ref().filter(is_new);
    let whole = |fitted, of| Other {
        fitted,
        unused: None,
        of,
        least: settings.plainer_gain,
    };
    let others = [
        (friction, "of the model with the usual friction"),
        (
            usual,
            "of the model with the effects that most machines have",
        ),
        (Some(declared), "of the declared model"),
    ];
    let others = others
        .into_iter()
        .filter_map(|(other, of)| Some(whole(other?, of)));
    // The zeros of sensors are unknown in logs that a fit has not seen.
    let of_rig =
        (chosen.standings.iter()).filter(|standing| !standing.effect.effect.is_of_sensor());
    let without = of_rig.filter_map(|standing| {
        let without = standing.without.as_ref().ok()?;
        // Most effects help on the logs set apart, which takes no refit to see.
        let less = error_apart(problem, without, apart);
        let other = || Other {
            fitted: without,
            unused: Some(&standing.effect),
            of: "without it",
            // An effect that does not help on left-out blocks either has nothing for it.
            least: match standing.gain > 0.0 {
                true => settings.plainer_gain,
                false => 0.0,
            },
        };
        (less <= least.apart).then(other)
    });
    let others: Vec<Other<'_>> = others.chain(without).collect();
    let gain = |other: &Other<'_>| {
        let left = LeftOut::of(problem, other.fitted, apart);
        left.gain_over(&least, other.least)
    };
    let gains: Vec<Option<f64>> = others.par_iter().map(gain).collect();
    let better = others.iter().zip(gains);
    let better = better.filter_map(|(other, gain)| Some((other, gain?)));
    let best = better.max_by(|(_, a), (_, b)| a.total_cmp(b));
    let Some((best, gain)) = best else {
        return Plainer::without(idle(problem, chosen)?);
    };
    Some(Plainer {
        fitted: best.fitted.clone(),
        unused: Unused {
            effect: best.unused.cloned(),
            why: format!(
                "on whole logs that the fit had not seen, the error {} is lower by {:.0} %",
                best.of,
                100.0 * (1.0 - (-gain).exp())
            ),
        },
    })
}

/// A transmission that is not established: with a body and a resonance more, a fit bends to whatever is missing.
fn doubtful_body(chosen: &Chosen) -> Option<&Standing> {
    let mut bodies = chosen.standings.iter();
    bodies.find(|standing| standing.effect.effect.is_transmission() && standing.reason.is_some())
}

/// The effect that does least, if the loss on left-out blocks hardly rises without it: beside effects that a plainer model
/// no longer has, it did more.
fn idle<'a>(problem: &Problem<'_>, chosen: &'a Chosen) -> Option<&'a Standing> {
    let most = problem.settings.select.negligible_rise;
    let idle = chosen.standings.iter();
    let idle = idle.filter(|standing| standing.gain < most && standing.reason.is_some());
    idle.min_by(|a, b| a.gain.total_cmp(&b.gain))
}

/// Whether the declared model predicts the motion of the logs set apart better by more than chance, whatever the logs
/// left out of the fit say: they are of the same kinds of motion as those that it saw.
fn is_harmful(problem: &Problem<'_>, declared: &Fitted, chosen: &Fitted, apart: &[Log]) -> bool {
    let of = |fitted| SetApart::of(problem, fitted, apart);
    problem.error_model == ErrorModel::OutputError
        && of(chosen).is_worse_than(&of(declared), problem.settings)
}

/// A plainer model than the chosen one, the effect that it does not use, if it is one, and how a sentence names its error.
struct Other<'a> {
    fitted: &'a Fitted,
    unused: Option<&'a FittedEffect>,
    of: &'static str,
    /// The share by which its error has to be lower.
    least: f64,
}

fn has_same_effects(a: &Fitted, b: &Fitted) -> bool {
    let [a, b] = [a, b].map(|fitted| &fitted.model.effects);
    a.len() == b.len() && a.iter().all(|a| b.iter().any(|b| a.is_same(b)))
}

/// Logarithms of a model's errors on whole logs that a fit has not seen; `None` if there are none.
struct LeftOut {
    /// Left out of the training logs in turn.
    in_turn: Option<f64>,
    apart: Option<f64>,
}

impl LeftOut {
    fn of(problem: &Problem<'_>, fitted: &Fitted, apart: &[Log]) -> Self {
        let (in_turn, apart) = rayon::join(
            || left_in_turn(problem, fitted),
            || error_apart(problem, fitted, apart),
        );
        Self {
            in_turn: in_turn.map(|squares| log_error(&squares)),
            apart,
        }
    }

    /// By how much the logarithm of the error is lower than another's, over both kinds of logs, if it is lower by more
    /// than `least` on one of them, and not higher by more on the other.
    fn gain_over(&self, other: &Self, least: f64) -> Option<f64> {
        let gain = |own: Option<f64>, other: Option<f64>| Some(other? - own?);
        let gains = [
            gain(self.in_turn, other.in_turn),
            gain(self.apart, other.apart),
        ];
        let known: Vec<f64> = gains.into_iter().flatten().collect();
        let sum: f64 = known.iter().sum();
        let is_lower = sum > 0.0 && known.iter().any(|gain| *gain > least);
        let is_contradicted = known.iter().any(|gain| *gain < -least);
        (is_lower && !is_contradicted).then_some(sum / known.len() as f64)
    }
}

fn error_apart(problem: &Problem<'_>, fitted: &Fitted, apart: &[Log]) -> Option<f64> {
    (!apart.is_empty()).then(|| log_error(&squares(problem, fitted, apart)))
}

/// The logarithm of the root of each sum of squares, on average.
fn log_error(squares: &[f64]) -> f64 {
    let sum: f64 = squares.iter().map(|square| 0.5 * square.ln()).sum();
    sum / squares.len() as f64
}

/// The squares on the training logs, each predicted by a fit to others; `None` for a single log, and for values of the rig
/// that belong to one log. The zeros of sensors are unknown there, as in the logs set apart.
fn left_in_turn(problem: &Problem<'_>, fitted: &Fitted) -> Option<Vec<f64>> {
    let groups = GROUPS.min(problem.logs.len());
    let effects = &fitted.model.effects;
    let of_rig = (effects.iter()).filter(|effect| !effect.effect.is_of_sensor());
    let mut of_rig = of_rig.flat_map(|effect| &effect.effect.parameters);
    let mut declared = fitted.model.parameters.iter();
    let is_of_one_log = of_rig.any(|parameter| parameter.per_log)
        || declared.any(|parameter| parameter.per_log && !parameter.per_group);
    if groups < 2 || is_of_one_log {
        return None;
    }
    let of_group = |group: usize| -> Vec<f64> {
        let split = |is_left_out: bool| -> Vec<Log> {
            let logs = problem.logs.iter().enumerate();
            let own = logs.filter(|(k, _)| (k % groups == group) == is_left_out);
            own.map(|(_, log)| log.clone()).collect()
        };
        let (kept, left_out) = (split(false), split(true));
        let problem = problem.on(&kept);
        let start_states = problem.shooting.initial_start_states(0);
        match problem.refit(&fitted.model, start_states, Some(fitted.fit.scale)) {
            Ok(refitted) => squares(&problem, &refitted, &left_out),
            Err(_) => vec![f64::INFINITY],
        }
    };
    let groups: Vec<Vec<f64>> = (0..groups).into_par_iter().map(of_group).collect();
    let longest = groups.iter().map(Vec::len).max()?;
    let sum = |k: usize| {
        groups
            .iter()
            .map(|squares| squares.get(k).unwrap_or(&f64::INFINITY))
            .sum()
    };
    Some((0..longest).map(sum).collect())
}

/// Sums of squares of the errors: of the open-loop motion at each horizon, or of the torques over their noise, with
/// friction that reverses as slowly as the smoothed torques do.
fn squares(problem: &Problem<'_>, fitted: &Fitted, logs: &[Log]) -> Vec<f64> {
    if problem.error_model == ErrorModel::InverseDynamics {
        let problem = problem.on(logs);
        let (dynamics, shooting) = (problem.compiled(&fitted.model), &problem.shooting);
        let values = Values::of(&dynamics, logs);
        let left = shooting.residuals(&dynamics, &values, &shooting.initial_start_states(0));
        return vec![left.iter().flatten().map(|left| left * left).sum()];
    }
    let dynamics = fitted.model.dynamics();
    let at = |horizon_s: &f64| {
        let of_log = |(k, log): (usize, &Log)| windows(k, log, *horizon_s);
        let windows: Vec<_> = logs.iter().enumerate().flat_map(of_log).collect();
        let errors = errors_in(&dynamics, logs, &windows, problem.shooting.steps());
        errors.iter().flat_map(|error| &error.position).sum()
    };
    problem.settings.score.horizons_s.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::LeftOut;

    #[test]
    fn a_plainer_model_has_to_be_better_by_more_than_chance() {
        let left = |in_turn: Option<f64>, apart: Option<f64>| LeftOut { in_turn, apart };
        let chosen = left(Some(0.0), Some(0.0));
        for (in_turn, apart, gain) in [
            (Some(-0.1), Some(0.0), Some(0.05)),
            (Some(0.01), Some(-0.1), Some(0.045)),
            // No better than chance on either, or better on one by less than it is worse on the other.
            (Some(-0.01), Some(-0.01), None),
            (Some(-0.1), Some(0.2), None),
            // Better on the whole, but one contradicts the other.
            (Some(-0.3), Some(0.1), None),
            (Some(-0.3), Some(0.01), Some(0.145)),
            // A single training log, and no log apart.
            (None, Some(-0.1), Some(0.1)),
            (None, None, None),
            // A model that diverges.
            (Some(f64::INFINITY), Some(-0.1), None),
        ] {
            let found = left(in_turn, apart).gain_over(&chosen, 0.02);
            let is_same = match (found, gain) {
                (Some(found), Some(gain)) => (found - gain).abs() < 1e-12,
                (found, gain) => found == gain,
            };
            assert!(is_same, "{in_turn:?}, {apart:?}: {found:?}, not {gain:?}");
        }
    }
}
