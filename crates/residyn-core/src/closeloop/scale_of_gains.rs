//! Stage 4: gains of drives at another scale of all forces.
//!
//! Without a known load, the motion of a limb tells the gains of its drives up to one factor: a limb whose first drive is weak
//! moves like a heavier one whose other drives are strong. A search that adds one effect after another ends at the scale that
//! has no gain on the joints that it did not begin with. What is declared of the bodies tells which scale is the likelier.

use rayon::prelude::*;

use super::bodies_off::BodiesOff;
use super::searched::Searched;
use super::select::{Trial, gains_relative_to, p_value};
use super::stage::Watch;
use crate::model::FittedEffect;

impl Searched<'_> {
    /// The same search with its gains at the scale at which one of them is none, if the bodies are nearer to the declared
    /// ones there.
    pub fn at_likelier_scale(self, watch: &dyn Watch) -> Self {
        let problem = &self.declared.problem;
        let gains = self.added().iter().filter(|added| added.effect.is_gain());
        let gains: Vec<&FittedEffect> = gains.collect();
        if gains.is_empty() || !problem.is_by_law() || !problem.has_free_bodies() {
            return self;
        }
        let found = Trial::of(problem, self.chosen.after.clone());
        let others = gains.into_par_iter();
        let others = others.filter_map(|gain| self.without_gain_on(&found, gain));
        let likelier = others.filter(|other| self.is_likelier(other, &found));
        match likelier.min_by(|a, b| self.off(a).total_cmp(&self.off(b))) {
            Some(likelier) => self.with(likelier, Vec::new(), watch),
            None => self,
        }
    }

    /// The set with gains on other joints in place of this one, at the scale that leaves its joint as it is declared: those
    /// that are significant there.
    fn without_gain_on(&self, found: &Trial, gain: &FittedEffect) -> Option<Trial> {
        let problem = &self.declared.problem;
        let model = &found.fitted.model;
        let (declared, added) = model.effects.split_at(problem.added(model).start);
        let (found_gains, others): (Vec<FittedEffect>, Vec<FittedEffect>) =
            (added.iter().cloned()).partition(|added| added.effect.is_gain());
        let rest = [declared, &others].concat();
        let mut gains = gains_relative_to(gain, &found_gains, model.joints)?;
        gains.retain(|gain| !declared.iter().any(|own| own.excludes(gain)));
        loop {
            let effects = [rest.as_slice(), &gains].concat();
            let fitted = problem.with_effects(&found.fitted, effects).ok()?;
            let significant = (rest.len()..).zip(&gains).filter(|(k, _)| {
                let level = problem.settings.establish.uncorrected_false_alarm;
                p_value(problem, &fitted, *k).is_some_and(|p| p < level)
            });
            let significant: Vec<FittedEffect> =
                significant.map(|(_, gain)| gain.clone()).collect();
            if significant.len() == gains.len() {
                let other = Trial::of(problem, fitted);
                return other.is_valid(problem).then_some(other);
            }
            gains = significant;
        }
    }

    /// Whether what is declared of the bodies speaks for another set, of whose values it may have more, that explains the
    /// logs as well.
    fn is_likelier(&self, other: &Trial, found: &Trial) -> bool {
        let problem = &self.declared.problem;
        let (nearer, farther) = (self.off(other), self.off(found));
        let is_shown = match other.values().0.saturating_sub(found.values().0) {
            0 => nearer < farther,
            more => {
                let bodies = BodiesOff::of(problem.declared, &found.fitted.model);
                let p_value = bodies.p_of_nearer(nearer, farther, 1 + more);
                p_value < problem.settings.establish.uncorrected_false_alarm
            }
        };
        is_shown && other.is_as_good_as(found, &problem.settings.select)
    }

    /// How far the bodies of a set are off the declared ones.
    fn off(&self, of: &Trial) -> f64 {
        BodiesOff::of(self.declared.problem.declared, &of.fitted.model).beside(0.0)
    }
}
