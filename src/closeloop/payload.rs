//! A load at the tip of an arm. Where the bodies of a chain are free, the last of them can stand for any load, and no torque
//! tells the two apart; but a body that is drawn is off by shares, and a load that it lacks makes it another one.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::establish::Standing;
use super::fitted::Fitted;
use super::study::Study;
use crate::data::Joint;
use crate::identify::Fit;
use crate::model::{Effect, Entry, FittedEffect, Status};

/// What a fit costs, with what the declared values do.
fn whole(fit: &Fit) -> f64 {
    fit.cost + fit.departure
}

impl Study<'_> {
    /// Whether the fit may change the bodies of a chain.
    pub(super) fn has_free_bodies(&self) -> bool {
        let mut parts = self.declared.inertias().into_iter().flatten();
        parts.any(|part| !self.declared.parameters[part].fixed)
    }

    /// The chosen model with a load at its tip, where most of what its bodies depart from the declared ones is one load.
    pub(super) fn with_payload(
        &self,
        chosen: &Fitted,
        library: &[Effect],
    ) -> Option<(Fitted, Standing)> {
        if !self.has_free_bodies() {
            return None;
        }
        let is_load = |effect: &&Effect| matches!(effect.entry, Entry::Payload(_));
        let effect = library.iter().find(is_load)?;
        let tip = Joint::at(self.declared.joints - 1);
        let is_there = chosen
            .model
            .effects
            .iter()
            .any(|other| other.effect == *effect);
        if is_there || self.declared.can_carry(effect, tip).is_err() {
            return None;
        }
        let with = self.fitted_with(chosen, effect, tip)?;
        let saved = whole(&chosen.fit) - whole(&with.fit);
        let settings = &self.settings.establish;
        let p_value = p_of(2.0 * saved, effect.parameters.len());
        let is_clear =
            saved > settings.of_departure * chosen.fit.departure && p_value < settings.false_alarm;
        let effect = with.model.effects.last()?.clone();
        is_clear.then(|| {
            let standing = Standing {
                effect,
                status: Status::Established,
                gain: saved / whole(&chosen.fit),
                p_value,
                reason: None,
                without: Ok(chosen.clone()),
            };
            (with, standing)
        })
    }

    /// The chosen model with a load that starts as heavy as the last body, where that is.
    fn fitted_with(&self, chosen: &Fitted, effect: &Effect, tip: Joint) -> Option<Fitted> {
        let last = *self.declared.inertias().last()?;
        let of = |part: usize| self.declared.parameters[last[part]].value;
        let mass = of(0).max(f64::MIN_POSITIVE);
        let mut load = FittedEffect::absent(effect, tip);
        for (value, parameter) in load.values.iter_mut().zip(&effect.parameters) {
            value.0 = match parameter.name.as_str() {
                "x" => of(1) / mass,
                "y" => of(2) / mass,
                "z" => of(3) / mass,
                _ => mass,
            };
        }
        let effects = [chosen.model.effects.as_slice(), &[load]].concat();
        self.with_effects(chosen, effects).ok()
    }
}

/// The probability of so large a fall of twice the cost by chance, where the declared bodies are off as they usually are.
fn p_of(twice: f64, values: usize) -> f64 {
    let by_chance = ChiSquared::new(values as f64).expect("there are values");
    1.0 - by_chance.cdf(twice.max(0.0))
}
