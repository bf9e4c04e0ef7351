//! Effects that do no more than a simpler one that they contain, as far as the logs show.

use nalgebra::DVector;

use super::error_model::ErrorModel;
use super::fitted::Fitted;
use super::plainer::Unused;
use super::problem::Problem;
use super::searched::Searched;
use super::select::{Trial, f_test, simpler};
use super::stage::Watch;
use crate::identify::{Uncertainty, submatrix, uncertainty};
use crate::model::FittedEffect;

/// Step of a difference quotient, as a share of the value.
const STEP: f64 = 1e-6;

impl Searched<'_> {
    /// The same search with a simpler effect in place of one whose difference from it is not significant in fine steps, if there
    /// is one: where a joint stands still, a richer law of friction always explains something of what coarse steps leave.
    pub(super) fn without_excess(&self, watch: &dyn Watch) -> Option<Self> {
        let problem = &self.declared.problem;
        let after = &self.chosen.after;
        let has_margin = |k: &usize| margin(&after.model.effects[*k]).is_some();
        let mut places = problem.added(&after.model).filter(has_margin).peekable();
        places.peek()?;
        if watch.has_to_end() {
            return None;
        }
        let fine = problem.finer(after);
        let refined = fine.estimate(after).ok()?;
        let spread = uncertainty(&fine.shooting, &refined.fit);
        let level = problem.settings.establish.uncorrected_false_alarm;
        places.find_map(|k| {
            let p = p_of_excess(&refined, after, &spread, k).filter(|p| *p > level)?;
            let simpler = simplified(problem, after, k)?;
            let effect = &after.model.effects[k];
            let unused = Unused {
                effect: Some(effect.clone()),
                why: format!(
                    "in fine steps the logs do not show that {} (p = {p:.2})",
                    effect.effect.valid_if.as_ref()?.text()
                ),
            };
            Some(self.with(simpler, vec![unused], watch))
        })
    }
}

/// The best fit in which the k-th effect is replaced by what it contains, if it leaves at most a little more of the loss on the
/// effect's joints.
fn simplified(problem: &Problem<'_>, fitted: &Fitted, k: usize) -> Option<Trial> {
    let whole = &fitted.model.effects[k];
    let on = |of: &Trial| of.losses.of_effect(whole).iter().sum::<f64>();
    let left_out = on(&Trial::of(problem, fitted.clone()));
    // No block is left out at a smaller loss than it is fitted with; along a value that the logs do not determine, the linearised
    // one may be.
    let loss = match problem.error_model {
        ErrorModel::OutputError => left_out.max(fitted.fit.cost),
        ErrorModel::InverseDynamics => left_out,
    };
    let most = (1.0 + problem.settings.select.simpler_rise) * loss;
    let sets = simpler(problem, &fitted.model.effects, k..k + 1).into_iter();
    let trials = sets.filter_map(|set| {
        let trial = Trial::of(problem, problem.with_effects(fitted, set).ok()?);
        (trial.is_valid(problem) && on(&trial) <= most).then_some(trial)
    });
    trials.min_by(|a, b| a.loss().total_cmp(&b.loss()))
}

/// Probability, by the cluster-robust Wald test, of the margin by which the k-th effect fulfils its `valid_if`, if there were none:
/// of `F_s > F_c`, that friction is no larger at standstill than in motion. The change from the `coarse` fit is taken off the
/// margin, as in the intervals of values. `None` of an effect without a free value in its margin.
fn p_of_excess(
    fitted: &Fitted,
    coarse: &Fitted,
    uncertainty: &Uncertainty,
    k: usize,
) -> Option<f64> {
    let [effect, before] = [fitted, coarse].map(|of| &of.model.effects[k]);
    let (found, before) = (margin(effect)?, margin(before)?);
    let own = fitted.model.place_of(k);
    let columns = fitted.fit.columns_of(|parameter| own.contains(&parameter));
    let slope = |&i: &usize| slope(effect, fitted.fit.columns[i].parameter - own.start);
    let slopes = DVector::from_iterator(columns.len(), columns.iter().map(slope));
    let covariance = submatrix(&uncertainty.covariance, &columns, &columns);
    let variance = slopes.dot(&(covariance * &slopes));
    let sure = (found.abs() - (found - before).abs()).max(0.0);
    (!columns.is_empty()).then(|| f_test(sure * sure / variance, 1, uncertainty.blocks))
}

/// By how much an effect's values fulfil its `valid_if`.
fn margin(effect: &FittedEffect) -> Option<f64> {
    let values: Vec<f64> = effect.values.iter().map(|(value, _)| *value).collect();
    effect.effect.margin(&values)
}

/// Derivative of an effect's margin with respect to one of its values.
fn slope(effect: &FittedEffect, of: usize) -> f64 {
    let step = STEP * effect.values[of].0.abs().max(f64::MIN_POSITIVE);
    let at = |sign: f64| {
        let mut moved = effect.clone();
        moved.values[of].0 += sign * step;
        margin(&moved).unwrap_or(f64::NAN)
    };
    (at(1.0) - at(-1.0)) / (2.0 * step)
}

#[cfg(test)]
mod tests {
    use super::{p_of_excess, simplified};
    use crate::closeloop::select::Trial;
    use crate::closeloop::tests::{FAST_PENDULUM, Study, pendulum};
    use crate::data::Joint;
    use crate::identify::uncertainty;
    use crate::model::{FittedEffect, Library};

    /// The probability of the excess over dry friction, and what takes its place.
    fn judged(hidden: &str) -> (f64, Option<String>) {
        let study = Study::of(pendulum(), &[FAST_PENDULUM, hidden].concat());
        let declared = study.fitted();
        let problem = &declared.problem;
        let stribeck = Library::built_in()
            .effect("stribeck_friction")
            .unwrap()
            .clone();
        let typical = FittedEffect::typical(&stribeck, Joint::at(0));
        let coarse = problem
            .with_effects(&declared.fitted, vec![typical])
            .unwrap();
        let fine = problem.finer(&coarse);
        let refined = fine.estimate(&coarse).unwrap();
        let spread = uncertainty(&fine.shooting, &refined.fit);
        let simpler = simplified(problem, &coarse, 0);
        let name = |trial: Trial| trial.fitted.model.effects[0].effect.name.clone();
        (
            p_of_excess(&refined, &coarse, &spread, 0).unwrap(),
            simpler.map(name),
        )
    }

    #[test]
    fn friction_that_is_no_larger_at_standstill_is_dry() {
        let (p, simpler) =
            judged("effect = [{ name = \"coulomb_friction\", joint = 1, F_c = 0.4 }]");
        assert!(p > 0.01, "{p}");
        assert_eq!(simpler.as_deref(), Some("coulomb_friction"));
    }

    #[test]
    fn friction_that_is_larger_at_standstill_is_not() {
        let hidden = "effect = [{ name = \"stribeck_friction\", joint = 1, F_c = 0.3, F_s = 0.6, v_s = 0.3 }]";
        let (p, simpler) = judged(hidden);
        assert!(p < 1e-4, "{p}");
        assert_eq!(simpler, None);
    }
}
