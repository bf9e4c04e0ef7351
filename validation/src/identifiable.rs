//! The fit of the true structure: the best that any search could reach.

use std::collections::BTreeMap;

use super::answer::{estimates, label_of};
use super::coverage::{Coverage, coverage};
use super::hidden::{Hidden, Label};
use super::judge::{Estimate, Truth};
use residyn_core::closeloop::{Fitted, Problem, Settings, Split, StudyError, with_intervals};
use residyn_core::data::Log;
use residyn_core::data::statistics::{mean, standard_error};
use residyn_core::identify::{Fit, blocks, uncertainty};
use residyn_core::model::{FittedEffect, Library, Model};
use residyn_core::sim::metric::assess;

/// Standard normal quantile of 95 %.
const ONE_SIDED: f64 = 1.645;
/// Errors within this factor of the true structure's count as equally small.
const AS_GOOD: f64 = 1.05;

/// A model with the true effects, fitted from their true values to the logs that a search uses.
pub struct Told<'a> {
    problem: Problem<'a>,
    library: &'a Library,
    split: &'a Split,
    settings: &'a Settings,
    fitted: Fitted,
}

/// A model whose declared parameters have their true values, if known.
pub fn at_truth(model: &Model, declared: &BTreeMap<String, f64>) -> Model {
    let mut model = model.clone();
    for parameter in &mut model.parameters {
        if let Some(value) = declared.get(&parameter.name).filter(|_| !parameter.fixed) {
            parameter.value = *value;
        }
    }
    model
}

impl<'a> Told<'a> {
    /// Fit the true structure; `None` if the library lacks one of the effects or the fit fails. Declared parameters
    /// start from the true values if all are known, else from the fit of the declared model.
    pub fn fit(
        declared: &'a Model,
        library: &'a Library,
        split: &'a Split,
        settings: &'a Settings,
        effects: &[Hidden],
        known: &BTreeMap<String, f64>,
    ) -> Option<Self> {
        let mut problem = Problem::new(declared, library, &split.train, settings);
        let truth: Vec<FittedEffect> = effects
            .iter()
            .map(|hidden| fitted(&problem, library, hidden))
            .collect::<Option<_>>()?;
        let mut free = declared.parameters.iter().filter(|p| !p.fixed);
        let (model, start_states) = if free.all(|p| known.contains_key(&p.name)) {
            let start_states = problem.shooting.initial_start_states(0);
            (at_truth(declared, known), start_states)
        } else {
            let before = problem.fit_declared().ok()?;
            problem = before.problem;
            (before.fitted.model, before.fitted.fit.start_states)
        };
        let found = problem
            .refit(&model.with_effects(truth), start_states, None)
            .ok()?;
        Some(Self {
            problem,
            library,
            split,
            settings,
            fitted: found,
        })
    }

    /// Open-loop position error, all joints together, at the middle horizon \[rad\].
    pub fn error(&self) -> f64 {
        self.error_on(&self.split.test, &self.fitted)
    }

    fn error_on(&self, logs: &[Log], fitted: &Fitted) -> f64 {
        let horizons = &self.settings.score.horizons_s;
        assess(&fitted.model.dynamics(), logs, horizons).position_rms()
    }

    /// Factor by which the error rises without the effect at this index, after a refit of the others; simpler effects
    /// that it contains stay. Infinite if the refit fails.
    pub fn rises_without(&self, place: usize) -> f64 {
        let mut effects = self.fitted.model.effects.clone();
        let gone = effects.remove(place);
        for name in &gone.effect.contains {
            let simpler = typical(&self.problem, self.library, name, &gone);
            effects.extend(simpler.filter(|new| !effects.iter().any(|old| old.excludes(new))));
        }
        let start_states = self.fitted.fit.start_states.clone();
        let other = self.fitted.model.with_effects(effects);
        let other = self.problem.refit(&other, start_states, None);
        other.map_or(f64::INFINITY, |other| self.rise(&other))
    }

    /// The error of another fit divided by the true structure's.
    fn rise(&self, other: &Fitted) -> f64 {
        let logs = self.judged_on();
        self.error_on(logs, other) / self.error_on(logs, &self.fitted)
    }

    /// Sets of effects that these logs cannot distinguish from the true one: one effect is exchanged for another that
    /// it is confused with and that has no more numbers, and the true set's loss is not smaller by more than chance
    /// (Vuong 1989), nor is its error smaller.
    pub fn twins(&self) -> Vec<Vec<Label>> {
        let places = 0..self.fitted.model.effects.len();
        places.flat_map(|place| self.twins_at(place)).collect()
    }

    fn twins_at(&self, place: usize) -> Vec<Vec<Label>> {
        let effects = &self.fitted.model.effects;
        let (of, mut others) = (&effects[place], effects.clone());
        others.remove(place);
        let names = of.effect.confused_with.iter();
        let rivals = names.filter_map(|name| typical(&self.problem, self.library, name, of));
        let simple = rivals.filter(|rival| rival.values.len() <= of.values.len());
        simple
            .filter(|rival| !others.iter().any(|other| other.excludes(rival)))
            .map(|rival| [others.as_slice(), &[rival]].concat())
            .filter(|set| self.is_as_good(set))
            .map(|set| set.iter().map(label_of).collect())
            .collect()
    }

    /// Whether the logs cannot distinguish this set of effects from the true one.
    fn is_as_good(&self, effects: &[FittedEffect]) -> bool {
        let Fitted { model, fit } = &self.fitted;
        let other = model.with_effects(effects.to_vec());
        let (start_states, scale) = (fit.start_states.clone(), Some(fit.scale));
        let Ok(other) = self.problem.refit(&other, start_states, scale) else {
            return false;
        };
        let blocks = blocks(&self.problem.shooting);
        let losses = |fit: &Fit| {
            fit.equations_by(&blocks)
                .into_iter()
                .map(|block| block.cost)
        };
        let more: Vec<f64> = losses(&other.fit)
            .zip(losses(fit))
            .map(|(a, b)| a - b)
            .collect();
        let by_chance = mean(&more) <= ONE_SIDED * standard_error(&more);
        by_chance && self.rise(&other) <= AS_GOOD
    }

    /// The test logs or, if there are per-log values, which are unknown there, the training logs.
    fn judged_on(&self) -> &[Log] {
        let effects = &self.fitted.model.effects;
        let mut parameters = effects.iter().flat_map(|effect| &effect.effect.parameters);
        if parameters.any(|parameter| parameter.per_log) {
            &self.split.train
        } else {
            &self.split.test
        }
    }

    /// Which 95 % intervals of the true structure hold the truth, after the last refinement.
    ///
    /// # Errors
    /// The fit in fine steps fails.
    pub fn coverage(&self, truth: &Truth) -> Result<Vec<Coverage>, StudyError> {
        let fine = self.problem.refined();
        let refined = fine.estimate(&self.fitted)?;
        let uncertainty = uncertainty(&fine.shooting, &refined.fit);
        let model = with_intervals(&fine, &refined, &uncertainty, &self.fitted.model);
        let all = model.all_parameters();
        let declared: Vec<Estimate> = all[..model.parameters.len()]
            .iter()
            .map(|parameter| Estimate::of(&parameter.name, parameter))
            .collect();
        let of_effect = |(k, effect): (usize, &FittedEffect)| {
            let found = estimates(effect, &all[model.place_of(k)]);
            (label_of(effect), found)
        };
        let effects: Vec<_> = model.effects.iter().enumerate().map(of_effect).collect();
        Ok(coverage(truth, &effects, &declared))
    }
}

/// A library effect on the joint of another, at its typical values.
fn typical(
    problem: &Problem<'_>,
    library: &Library,
    name: &str,
    like: &FittedEffect,
) -> Option<FittedEffect> {
    let effect = library.effect(name).ok()?;
    problem.declared.can_carry(effect, like.joint).ok()?;
    let joint = like.joint;
    let effect = problem.measured(effect, joint);
    Some(FittedEffect::typical(&effect, joint))
}

/// The effect with its true values; `None` if the library has no such effect.
fn fitted(problem: &Problem<'_>, library: &Library, hidden: &Hidden) -> Option<FittedEffect> {
    if hidden.name == "parameter_shift" {
        return shift(problem.declared, hidden);
    }
    let joint = hidden.joint;
    let effect = library.effect(&hidden.name).ok()?;
    let effect = problem.measured(effect, joint);
    let mut fitted = FittedEffect::absent(&effect, joint);
    for (slot, parameter) in fitted.values.iter_mut().zip(&effect.parameters) {
        slot.0 = match hidden.values.get(&parameter.name) {
            // Values per log start from zero.
            _ if parameter.per_log => 0.0,
            Some(value) => *value,
            // It selects a form of the effect's formula; the rig has no such number.
            None if parameter.whole => parameter.typical,
            None => return None,
        };
    }
    Some(fitted)
}

fn shift(model: &Model, hidden: &Hidden) -> Option<FittedEffect> {
    let (name, value) = hidden.values.first_key_value()?;
    let declared = model.parameters.iter().find(|p| p.name == *name)?;
    let mut shifts = model.shifts().into_iter();
    let mut shift = shifts.find(|shift| shift.effect.parameters[0].name == *name)?;
    shift.values[0].0 = value - declared.value;
    Some(shift)
}
