//! A payload at the tip of an arm. If the bodies of a chain are free, the last one can stand for any payload, and no
//! torque distinguishes the two; but a body known from a drawing is off by a fraction only, and a missing payload would
//! make it a different body.

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::establish::Standing;
use super::fitted::Fitted;
use super::problem::Problem;
use crate::data::Joint;
use crate::identify::Fit;
use crate::model::{Effect, Entry, FittedEffect};

/// The cost of a fit, including that of its prior.
fn whole(fit: &Fit) -> f64 {
    fit.cost + fit.prior_cost
}

impl Problem<'_> {
    /// Whether the fit may change the bodies of a chain.
    pub(super) fn has_free_bodies(&self) -> bool {
        let mut parts = self.declared.inertias().into_iter().flatten();
        parts.any(|part| !self.declared.parameters[part].fixed)
    }

    /// The chosen model with a load at its tip, if one load accounts for most of its bodies' departure from the
    /// declared ones.
    pub(super) fn with_payload(&self, chosen: &Fitted) -> Option<(Fitted, Standing)> {
        if !self.has_free_bodies() {
            return None;
        }
        let is_load = |effect: &&Effect| matches!(effect.entry, Entry::Payload(_));
        let effect = self.effects().iter().find(is_load)?;
        let tip = Joint::at(self.declared.joints - 1);
        let mut present = chosen.model.effects.iter();
        let is_there = present.any(|other| other.effect == *effect);
        if is_there || self.declared.can_carry(effect, tip).is_err() {
            return None;
        }
        let starts = self.loads(chosen, effect, tip)?.into_par_iter();
        let fits = starts.filter_map(|load| self.loaded(chosen, load));
        let with = fits.min_by(|a, b| whole(&a.fit).total_cmp(&whole(&b.fit)))?;
        let saved = whole(&chosen.fit) - whole(&with.fit);
        let settings = &self.settings.establish;
        let p_value = p_of_departure(2.0 * saved, effect.parameters.len());
        let is_clear = saved > settings.payload_share * chosen.fit.prior_cost
            && p_value < settings.false_alarm;
        let effect = with.model.effects.last()?.clone();
        is_clear.then(|| {
            let evidence = (saved / whole(&chosen.fit), p_value);
            let standing = Standing::sure(effect, evidence, Ok(chosen.clone()));
            (with, standing)
        })
    }

    /// Loads of several masses, each placed to change the last body's first moments as the chosen model did.
    fn loads(&self, chosen: &Fitted, effect: &Effect, tip: Joint) -> Option<[FittedEffect; 4]> {
        let last = *self.declared.inertias().last()?;
        let declared = |part: usize| self.declared.parameters[last[part]].value;
        let fitted = |part: usize| chosen.model.parameters[last[part]].value;
        let load = |masses: f64| {
            let mass = (masses * declared(0)).max(f64::MIN_POSITIVE);
            let place = |part: usize| (fitted(part) - declared(part)) / mass;
            let mut load = FittedEffect::absent(effect, tip);
            for (value, parameter) in load.values.iter_mut().zip(&effect.parameters) {
                value.0 = match parameter.name.as_str() {
                    "x" => place(1),
                    "y" => place(2),
                    "z" => place(3),
                    _ => mass,
                };
            }
            load
        };
        Some(self.settings.establish.payload_masses.map(load))
    }

    /// The chosen model with a load, fitted from the declared bodies: the chosen model's bodies already absorb the
    /// load.
    fn loaded(&self, chosen: &Fitted, load: FittedEffect) -> Option<Fitted> {
        let mut start = chosen.clone();
        for part in self.declared.inertias().into_iter().flatten() {
            start.model.parameters[part] = self.declared.parameters[part].clone();
        }
        let effects = start.effects_and(&[load]);
        self.with_effects(&start, effects).ok()
    }
}

/// The probability that twice the cost falls this much by chance with so many more values, if the declared bodies are off as
/// they usually are.
pub(super) fn p_of_departure(twice: f64, values: usize) -> f64 {
    let by_chance = ChiSquared::new(values as f64).expect("there are values");
    1.0 - by_chance.cdf(twice.max(0.0))
}
