//! Stage 5: what the unexplained residual, single logs and gravity say about the established effects.

use rand::Rng;
use rayon::prelude::*;

use super::diagnostics::{Unexplained, diagnose};
use super::error_model::ErrorModel;
use super::establish::{Chosen, Standing};
use super::every_log::{EveryLog, SetApart};
use super::fit::Declared;
use super::fitted::Fitted;
use super::gravity::{against_gravity, shares_of_gravity};
use super::loss::Loss;
use super::one_way::moves_one_way;
use super::payload::p_of_departure;
use super::problem::Problem;
use super::refine::Refined;
use super::scaled_bodies::scaled_bodies;
use super::select::p_value;
use crate::data::Log;
use crate::model::{Effect, Entry, FittedEffect, Model, Status};

/// What the declared model lacks, judged by the logs.
pub struct Found<'a> {
    /// With what the logs determine of the declared parameters, given the effects.
    pub problem: Problem<'a>,
    /// The declared model, fitted.
    pub before: Fitted,
    pub chosen: Chosen,
    pub unexplained: Unexplained,
    /// The share of the declared gravity in the torques of each log, if torques are compared and gravity loads the
    /// joints.
    pub gravity: Vec<Option<f64>>,
}

/// Demote established effects if the residual that is `left`, single logs or gravity give a reason, and look for a load
/// at the tip.
pub(super) fn judge<'a>(
    declared: Declared<'a>,
    mut chosen: Chosen,
    mut left: Unexplained,
    apart: &[Log],
    rng: &mut impl Rng,
) -> Found<'a> {
    let Declared {
        problem,
        fitted: before,
    } = declared;
    if left.is_significant() {
        chosen.doubt(&problem, &before, &left);
    }
    chosen.ask_both_directions(&problem);
    match problem.error_model {
        ErrorModel::OutputError => chosen.ask_logs_apart(&problem, apart),
        ErrorModel::InverseDynamics => {
            chosen.ask_every_log(&problem, apart);
            chosen.ask_places(&problem, apart);
            if let Some((after, standing)) = problem.with_payload(&chosen.after) {
                chosen.after = after;
                chosen.standings.push(standing);
            }
        }
    }
    let gravity = shares_of_gravity(&problem);
    if against_gravity(&gravity, &problem.settings.notes).is_some() {
        demote(&mut chosen.standings, |_| Some(ANOTHER_GRAVITY.into()));
    }
    mark(&mut chosen.after.model, &chosen.standings);
    if chosen.established() == 0 && !chosen.standings.is_empty() {
        // Effects that are not established explain nothing.
        left = diagnose(&problem, &before, &before, rng);
    }
    Found {
        problem: problem.knowing(problem.identifiability_of(&chosen.after)),
        before,
        chosen,
        unexplained: left,
        gravity,
    }
}

/// Why effects that leave most of the loss and an unexplained residual are not established.
const MASKING: &str = "an unexplained residual remains, and all effects together cut the loss by less than half: it \
                       would mask the real cause";

/// Why effects that are fitted to only a part of the torques are not established.
const ANOTHER_GRAVITY: &str = "the torques do not match the gravity torque of the declared bodies, and the effect may \
                               imitate the difference";

/// Why an effect is not established if the unexplained residual is larger.
const OUTWEIGHED: &str =
    "more than twice what it explains remains unexplained: it may be only a part of the real cause";

impl Chosen {
    /// Effects are not established if most of what their joint lacks, or more than they explain, stays unexplained, unless
    /// they were established where nothing stayed unexplained.
    fn doubt(&mut self, problem: &Problem<'_>, before: &Fitted, diagnostics: &Unexplained) {
        let settings = &problem.settings.establish;
        let [declared, with] = [before, &self.after].map(|model| Loss::of(problem, model));
        let left = |of: &Loss, effect: &FittedEffect| {
            of.on(effect) / declared.on(effect).max(f64::MIN_POSITIVE)
        };
        let masks = |effect: &FittedEffect| {
            diagnostics.matters_on(problem, effect.joint)
                && left(&with, effect) > settings.masking_share
        };
        let is_outweighed = |standing: &Standing| {
            let effect = &standing.effect;
            let least = settings.outweighed_share * diagnostics.fraction_on(problem, effect.joint);
            let without = standing.without.as_ref();
            let without = without.map(|without| Loss::of(problem, without));
            without.is_ok_and(|without| left(&without, effect) - left(&with, effect) < least)
        };
        let unmasked = &self.unmasked;
        demote(&mut self.standings, |standing| {
            if unmasked.iter().any(|own| own.is_same(&standing.effect)) {
                return None;
            }
            let masks = masks(&standing.effect).then_some(MASKING);
            let reason = masks.or_else(|| is_outweighed(standing).then_some(OUTWEIGHED))?;
            Some(reason.into())
        });
    }

    /// Effects of the velocity are not established if their joint moves in one direction only: there a constant force
    /// would do as well.
    fn ask_both_directions(&mut self, problem: &Problem<'_>) {
        let joints = 0..problem.declared.joints;
        let one_way: Vec<bool> = joints
            .map(|joint| moves_one_way(problem.logs, joint))
            .collect();
        demote(&mut self.standings, |standing| {
            let formula = standing.effect.effect.entry.formula();
            let of_velocity = formula.is_some_and(|formula| formula.names().contains(&"qd"));
            (of_velocity && one_way[standing.effect.joint.index()])
                .then(|| "its joint moves in one direction only".into())
        });
    }

    /// Effects are not established if they raise the open-loop error of a log set apart.
    fn ask_logs_apart(&mut self, problem: &Problem<'_>, apart: &[Log]) {
        let with = SetApart::of(problem, &self.after, apart);
        demote(&mut self.standings, |standing| {
            // The zeros of sensors are unknown there.
            if standing.effect.effect.is_of_sensor() {
                return None;
            }
            let without = standing.without.as_ref().ok()?;
            let without = SetApart::of(problem, without, apart);
            let log = with.worse_than(&without, problem.settings)?;
            Some(format!("it raises the error on {}", apart[log].name()))
        });
    }

    /// Effects are not established if the torques of some log fit as well without them, unless bodies that contradict the
    /// declared ones would take their place.
    fn ask_every_log(&mut self, problem: &Problem<'_>, apart: &[Log]) {
        let logs = EveryLog::of(problem, problem.logs.iter().chain(apart), &self.after);
        let (level, own) = (problem.settings.establish.false_alarm, &self.after);
        demote(&mut self.standings, |standing| {
            let without = standing.without.as_ref().ok()?;
            let is_drawn = problem.is_by_law() && p_of_bodies(own, without) < level;
            let log = logs.fits_as_well_without(standing).filter(|_| !is_drawn)?;
            Some(format!(
                "the torques of {} fit as well without it",
                log.name()
            ))
        });
    }

    /// Forces that depend on the angle are not established if a fit to the logs set apart alone does not show them: over
    /// the range of a few logs they follow whatever the model lacks.
    fn ask_places(&mut self, problem: &Problem<'_>, apart: &[Log]) {
        if apart.is_empty() || !self.named().any(depends_on_angle) {
            return;
        }
        let problem = problem.on(apart);
        let start_states = problem.shooting.initial_start_states(0);
        let Ok(alone) = problem.refit(&self.after.model, start_states, None) else {
            return;
        };
        let most = problem.settings.establish.uncorrected_false_alarm;
        let first = problem.declared.effects.len();
        let effects: Vec<FittedEffect> = self.after.model.effects[first..].to_vec();
        demote(&mut self.standings, |standing| {
            let place = effects
                .iter()
                .position(|own| own.is_same(&standing.effect))?;
            let p = p_value(&problem, &alone, first + place)?;
            (depends_on_angle(&standing.effect) && p > most)
                .then(|| format!("a fit to the logs set apart alone does not show it (p = {p:.2})"))
        });
    }

    /// Effects are not established if nothing is left of their evidence in fine steps: what the coarser ones showed was
    /// their own error.
    pub(super) fn confirm(&mut self, refined: &mut Refined<'_>) {
        let (problem, least) = (
            &refined.problem,
            refined.problem.settings.establish.uncorrected_false_alarm,
        );
        let added = problem.added(&refined.after.model);
        let reason = |k: usize| match refined.p_value(k) {
            Some(p) if p > least => Some(format!(
                "in finer steps its value is not significant (p = {p:.2})"
            )),
            _ if holds_zero(&refined.after.model.effects[k]) => {
                Some("the interval of its size holds zero".into())
            }
            _ => scaled_bodies(problem, &refined.after.model, k),
        };
        let reasons: Vec<Option<String>> = added.map(reason).collect();
        for (standing, reason) in self.standings.iter_mut().zip(reasons) {
            if reason.is_some() && standing.status == Status::Established {
                standing.status = Status::Supported;
                standing.reason = reason;
            }
        }
        mark(&mut refined.after.model, &self.standings);
        mark(&mut self.after.model, &self.standings);
    }
}

/// The probability that the declared values are off by so much more without an effect than with it.
fn p_of_bodies(with: &Fitted, without: &Fitted) -> f64 {
    p_of_departure(2.0 * (without.fit.prior_cost - with.fit.prior_cost), 1)
}

fn depends_on_angle(effect: &FittedEffect) -> bool {
    let Entry::Force(formula) = &effect.effect.entry else {
        return false;
    };
    let names = formula.names();
    names.contains(&"q") && !names.contains(&"qd")
}

/// Whether an effect may be absent: zero lies within the interval of each value that is zero without it. Where a load sits
/// says nothing of that.
pub(super) fn holds_zero(effect: &FittedEffect) -> bool {
    let Effect {
        parameters, entry, ..
    } = &effect.effect;
    let values = parameters.iter().zip(&effect.values);
    let switches = values.filter(|(parameter, _)| {
        parameter.is_switch() && !entry.needed().contains(&parameter.name.as_str())
    });
    let mut intervals = switches.map(|(_, (_, interval))| *interval).peekable();
    intervals.peek().is_some()
        && intervals.all(|interval| interval.is_some_and(|[low, high]| low <= 0.0 && high >= 0.0))
}

/// Record the status of each added effect in a model.
pub(super) fn mark(model: &mut Model, standings: &[Standing]) {
    let declared = model.effects.len() - standings.len();
    for (effect, standing) in model.effects[declared..].iter_mut().zip(standings) {
        effect.status = Some(standing.status);
    }
}

/// Demote established effects to supported if there is a reason.
fn demote(standings: &mut [Standing], reason: impl Fn(&Standing) -> Option<String> + Sync) {
    let established = |standing: &&mut Standing| standing.status == Status::Established;
    let judge = |standing: &mut Standing| {
        if let Some(reason) = reason(standing) {
            standing.status = Status::Supported;
            standing.reason = Some(reason);
        }
    };
    (standings.par_iter_mut().filter(established)).for_each(judge);
}
