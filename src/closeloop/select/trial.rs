use super::evidence::gain;
use super::losses::Losses;
use super::outlook::tells_apart;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::settings::SelectSettings;
use crate::closeloop::study::Study;
use crate::data::Joint;
use crate::data::statistics::{mean, standard_error};
use crate::model::{EffectParameter, FittedEffect};

/// A model with some set of effects, fitted and judged by stretches left out of the fit.
#[derive(Debug, Clone)]
pub struct Trial {
    pub fitted: Fitted,
    /// On each stretch, with the parameters that a fit without it would give. Comparable among trials that were fitted at
    /// the same scale.
    pub losses: Losses,
}

impl Trial {
    pub fn of(study: &Study<'_>, fitted: Fitted) -> Self {
        let losses = Losses::of(study, &fitted);
        Self { fitted, losses }
    }

    /// Loss over all stretches.
    pub fn loss(&self) -> f64 {
        self.losses.total()
    }

    /// Number of free values, then of simpler effects that the added ones contain.
    pub fn values(&self) -> (usize, usize) {
        let effects = &self.fitted.model.effects;
        let contained = effects.iter().map(|effect| effect.effect.contains.len());
        (self.fitted.fit.columns.len(), contained.sum())
    }

    /// Number of parameters that are not where the file holds them: of sets that are as good, the one that contradicts the
    /// file least is chosen.
    pub fn shifts(&self) -> usize {
        let effects = self.fitted.model.effects.iter();
        effects.filter(|effect| effect.shifted().is_some()).count()
    }

    /// Whether every added effect has values that are consistent with each other and that the logs tell from all others:
    /// a value that stands at a bound was not found there, unless it is zero and the effect absent.
    pub fn is_valid(&self, study: &Study<'_>) -> bool {
        self.is_consistent(study) && self.is_determined(study)
    }

    fn is_determined(&self, study: &Study<'_>) -> bool {
        let (model, fit) = (&self.fitted.model, &self.fitted.fit);
        let added = study.added(model);
        if added.is_empty() {
            return true;
        }
        let first = model.place_of(added.start).start;
        let columns = &fit.columns;
        let told = |&i: &usize| study.is_told(columns[i].parameter);
        let told: Vec<usize> = (0..columns.len()).filter(told).collect();
        let base = told.iter().filter(|&&i| columns[i].parameter < first);
        let information = fit.equations().hessian;
        let information = information.select_rows(&told).select_columns(&told);
        tells_apart(&information, base.count())
    }

    /// Whether the values of each added effect are consistent with each other and none stands at a bound.
    pub fn is_consistent(&self, study: &Study<'_>) -> bool {
        self.added(study).iter().all(is_consistent)
    }

    /// The effects beyond the declared ones.
    pub fn added(&self, study: &Study<'_>) -> &[FittedEffect] {
        &self.fitted.model.effects[study.added(&self.fitted.model)]
    }

    /// Identifies the set of effects, in no particular order.
    pub fn key(&self) -> Vec<String> {
        key(&self.fitted.model.effects)
    }

    /// The same of the effects beyond the declared ones.
    pub fn added_key(&self, study: &Study<'_>) -> Vec<String> {
        key(self.added(study))
    }

    /// Whether this simpler set explains the logs as well as the best one: its loss is no more than a little larger, and not
    /// significantly so, altogether and on each joint where the two differ.
    pub fn is_as_good_as(&self, best: &Self, settings: &SelectSettings) -> bool {
        let is_as_good = |own: &[f64], best: &[f64]| {
            let rise = -gain(best, own);
            let differences = differences(own, best);
            let within = mean(&differences) <= settings.simplest * standard_error(&differences);
            rise < settings.negligible || within && rise < settings.simpler
        };
        let on_joint =
            |joint: Joint| is_as_good(&self.losses.of_joint(joint), &best.losses.of_joint(joint));
        is_as_good(&self.losses.values, &best.losses.values)
            && self.differs_on(best).into_iter().all(on_joint)
    }

    /// The joints of effects that one of two trials has and the other has not.
    fn differs_on(&self, other: &Self) -> Vec<Joint> {
        let not_in = |a: &Self, b: &Self| -> Vec<Joint> {
            let known = b.key();
            let effects = a.fitted.model.effects.iter();
            let other = effects.filter(|effect| !known.contains(&identity(effect)));
            other.flat_map(FittedEffect::joints).collect()
        };
        [not_in(self, other), not_in(other, self)].concat()
    }
}

/// Whether the values of an effect are consistent with each other and none stands at a bound.
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

/// The effects of a model, in no particular order.
pub fn key(effects: &[FittedEffect]) -> Vec<String> {
    let mut key: Vec<String> = effects.iter().map(identity).collect();
    key.sort();
    key
}

/// The name of an effect, its joint and its whole numbers: a ripple of another number of periods is another effect.
pub fn identity(effect: &FittedEffect) -> String {
    let values = effect.effect.parameters.iter().zip(&effect.values);
    let whole = values.filter(|(parameter, _)| parameter.whole);
    whole.fold(effect.label(), |label, (parameter, (value, _))| {
        format!("{label}, {} = {value}", parameter.name)
    })
}

pub fn differences(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}
