use super::identity::EffectId;
use super::knowledge::Knowledge;
use super::losses::Losses;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::settings::SelectSettings;
use crate::data::Joint;
use crate::data::statistics::{mean, standard_error};
use crate::model::{EffectParameter, FittedEffect};

/// A model with a set of effects, fitted and judged on blocks left out of the fit.
#[derive(Debug, Clone)]
pub struct Trial {
    pub fitted: Fitted,
    /// The loss on each block, with the parameters that a fit without the block would give; comparable among trials
    /// fitted at the same scale.
    pub losses: Losses,
    /// What the declared values say against those of the model, in the unit of the losses, if torques follow from the law
    /// of drives. Only they tell the scale of forces then: of sets that explain the logs alike, the one that leaves the rig
    /// as it is drawn is the likelier.
    prior: f64,
    /// Identifies the model's effects, in their order.
    ids: Vec<EffectId>,
}

impl Trial {
    pub fn of(problem: &Problem<'_>, fitted: Fitted) -> Self {
        let effects = fitted.model.effects.iter();
        Self {
            losses: Losses::of(problem, &fitted),
            prior: match problem.is_by_law() {
                true => fitted.fit.prior_cost,
                false => 0.0,
            },
            ids: effects.map(|effect| problem.id(effect)).collect(),
            fitted,
        }
    }

    /// The same trial as a start for fits with more effects: at the values of the first optimum, if there is one.
    pub(super) fn moved_to_first_optimum(&self, problem: &Problem<'_>) -> Self {
        let Some(first) = &problem.first else {
            return self.clone();
        };
        let own = first.model.effects[..problem.declared.effects.len()].to_vec();
        let mut fit = self.fitted.fit.clone();
        fit.start_states.clone_from(&first.fit.start_states);
        let model = first.model.with_effects(own);
        Self {
            fitted: Fitted { model, fit },
            ..self.clone()
        }
    }

    /// The same without the normal equations of its fit's windows.
    pub(super) fn without_windows(self) -> Self {
        Self {
            fitted: self.fitted.without_windows(),
            ..self
        }
    }

    /// Loss over all blocks, and by the declared values.
    pub fn loss(&self) -> f64 {
        self.losses.total() + self.prior
    }

    /// The loss in units of the sensors' noise, whatever the scale.
    pub fn loss_in_noise(&self) -> f64 {
        self.loss() * self.fitted.fit.scale.powi(2)
    }

    /// Whether the loss, in units of the sensors' noise, is below another by a large share.
    pub fn has_fallen_far(&self, before: f64, settings: &SelectSettings) -> bool {
        self.loss_in_noise() < before * (1.0 - settings.large_gain)
    }

    /// The loss on the joints of an effect, and by the declared values, as a share of that of the trial without the effect:
    /// by how much it falls.
    pub fn gain_over(&self, without: &Self, effect: &FittedEffect) -> f64 {
        let [with, less] = self.beside(without, effect);
        1.0 - with.iter().sum::<f64>() / less.iter().sum::<f64>().max(f64::MIN_POSITIVE)
    }

    /// By how much less the declared values are contradicted than without the effect, as the same share.
    pub fn gain_by_declared(&self, without: &Self, effect: &FittedEffect) -> f64 {
        let [[_, with], less] = self.beside(without, effect);
        (less[1] - with) / less.iter().sum::<f64>().max(f64::MIN_POSITIVE)
    }

    /// The losses on the joints of an effect and by the declared values, of the trial and of that without the effect. What
    /// both leave of the declared values is no loss of the effect's.
    fn beside(&self, without: &Self, effect: &FittedEffect) -> [[f64; 2]; 2] {
        let common = self.prior.min(without.prior);
        let on_joints = |of: &Self| of.losses.of_effect(effect).iter().sum();
        [self, without].map(|of| [on_joints(of), of.prior - common])
    }

    /// Number of free values, and of simpler effects that the effects of the model contain.
    pub fn values(&self) -> (usize, usize) {
        let effects = &self.fitted.model.effects;
        let contained = effects.iter().map(|effect| effect.effect.contains.len());
        (self.fitted.fit.columns.len(), contained.sum())
    }

    /// Number of parameters shifted from the values that the file fixes: of equally good sets, the one that contradicts
    /// the file least is chosen.
    pub fn shifts(&self) -> usize {
        let effects = self.fitted.model.effects.iter();
        effects.filter(|effect| effect.shifted().is_some()).count()
    }

    /// Whether the values of every added effect are consistent with each other and distinguished by the logs from all
    /// others: a value at a bound was not found there, unless it is zero and the effect absent.
    pub fn is_valid(&self, problem: &Problem<'_>) -> bool {
        self.is_consistent(problem) && self.is_determined(problem)
    }

    fn is_determined(&self, problem: &Problem<'_>) -> bool {
        self.determines(problem, |_| true)
    }

    /// Whether the logs distinguish all values of those added effects that may not be held where their fit starts.
    pub fn determines_what_is_not_held(&self, problem: &Problem<'_>) -> bool {
        self.determines(problem, |effect| effect.with_unknown_held().is_none())
    }

    /// Whether the logs distinguish the values of these added effects from all others.
    fn determines(&self, problem: &Problem<'_>, is_asked: impl Fn(&FittedEffect) -> bool) -> bool {
        let (model, fit) = (&self.fitted.model, &self.fitted.fit);
        let added = problem.added(model);
        if added.is_empty() {
            return true;
        }
        let first = model.place_of(added.start).start;
        let message = fit.columns_of(|k| problem.is_identifiable(k));
        let is_base = |i: &&usize| fit.columns[**i].parameter < first;
        let base = message.iter().filter(is_base).count();
        let (base, own) = message.split_at(base);
        let asked = added.filter(|k| is_asked(&model.effects[*k]));
        let places: Vec<_> = asked.map(|k| model.place_of(k)).collect();
        let is_asked = |i: usize| {
            let mut places = places.iter();
            places.any(|place| place.contains(&fit.columns[i].parameter))
        };
        Knowledge::of(problem, model, fit, base).distinguishes_all_of(own, is_asked)
    }

    /// Whether the values of each added effect are consistent with each other and none is at a bound.
    pub fn is_consistent(&self, problem: &Problem<'_>) -> bool {
        self.added(problem).iter().all(is_consistent)
    }

    /// The effects beyond the declared ones.
    pub fn added(&self, problem: &Problem<'_>) -> &[FittedEffect] {
        &self.fitted.model.effects[problem.added(&self.fitted.model)]
    }

    /// Identifies the set of effects, in no particular order.
    pub fn key(&self) -> Vec<EffectId> {
        let mut key = self.ids.clone();
        key.sort();
        key
    }

    /// As [`Trial::key`], for the effects beyond the declared ones.
    pub fn added_key(&self, problem: &Problem<'_>) -> Vec<EffectId> {
        problem.key(self.added(problem))
    }

    /// Whether this simpler set explains the logs as well as the best one: its loss is at most a little larger, and not
    /// significantly so, in total and on each joint where the two differ.
    pub fn is_as_good_as(&self, best: &Self, settings: &SelectSettings) -> bool {
        // `by_prior` is what the declared values add to the difference.
        let is_as_good = |own: &[f64], best: &[f64], by_prior: f64| {
            let differences = differences(own, best);
            let more = mean(&differences) + by_prior / own.len() as f64;
            let rise = more / mean(best).max(f64::MIN_POSITIVE);
            let within = more <= settings.simpler_standard_errors * standard_error(&differences);
            rise < settings.negligible_rise || within && rise < settings.simpler_rise
        };
        let on_joint = |joint: Joint| {
            is_as_good(
                &self.losses.of_joint(joint),
                &best.losses.of_joint(joint),
                0.0,
            )
        };
        let by_prior = self.prior - best.prior;
        is_as_good(&self.losses.values, &best.losses.values, by_prior)
            && self.differs_on(best).into_iter().all(on_joint)
    }

    /// The joints of effects that only one of two trials has.
    fn differs_on(&self, other: &Self) -> Vec<Joint> {
        let not_in = |a: &Self, b: &Self| -> Vec<Joint> {
            let effects = a.fitted.model.effects.iter().zip(&a.ids);
            let other = effects.filter(|(_, id)| !b.ids.contains(id));
            other.flat_map(|(effect, _)| effect.joints()).collect()
        };
        [not_in(self, other), not_in(other, self)].concat()
    }
}

/// Whether the values of an effect are consistent with each other and none is at a bound.
pub fn is_consistent(effect: &FittedEffect) -> bool {
    let values: Vec<f64> = effect.values.iter().map(|(value, _)| *value).collect();
    let mut shapes = effect.effect.parameters.iter().zip(&values);
    let is_inside = |(parameter, value): (&EffectParameter, &f64)| {
        let [low, high] = parameter.bounds;
        let is_absent = parameter.is_switch() && *value == 0.0;
        is_absent || parameter.whole || (low < *value && *value < high)
    };
    effect.effect.is_valid(&values) && shapes.all(is_inside)
}

pub fn differences(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}
