//! Stage 5, at its end: friction that the torques of drives' laws leave out, where the motion under the commands asks for it.
//!
//! In torques, a limit that falls with speed and a delay that is a little too long look like viscous friction, and the search
//! takes whichever it meets first. Each moves the machine in another way.

use rayon::prelude::*;

use super::by_motion::{Comparison, by_limbs, estimate};
use super::establish::Standing;
use super::judge::{Found, mark};
use super::limbs::Limb;
use super::select::{baseline_friction, p_value};
use crate::data::Joint;
use crate::model::FittedEffect;

/// A friction of the whole's, and how it shows in the motion: by how much the loss falls, and the probability of its value.
type Asked = (FittedEffect, (f64, f64));

impl Found<'_> {
    /// Add the friction that most machines have to joints on which it is not established, wherever the motion is fitted
    /// better by a share that is of use.
    pub(super) fn add_friction_by_motion(&mut self) {
        if !self.problem.is_by_law() {
            return;
        }
        let doubtful = self.doubtful_friction();
        let limbs = by_limbs(&self.problem, &self.chosen.after.model);
        let asked = limbs.par_iter().flat_map_iter(|limb| {
            let is_own = |friction: &&FittedEffect| limb.joints().contains(&friction.joint);
            let own = doubtful.iter().filter(is_own).cloned().collect();
            self.asked(limb, own)
        });
        let asked: Vec<Asked> = asked.collect();
        self.add(&asked);
    }

    /// The friction of most machines that is not established.
    fn doubtful_friction(&self) -> Vec<FittedEffect> {
        let mut friction = baseline_friction(&self.problem);
        friction.retain(|new| !self.chosen.named().any(|known| known.excludes(new)));
        friction
    }

    /// The friction that the motion of a limb asks for: of what is in doubt, all without which the loss would rise.
    fn asked(&self, limb: &Limb, mut doubtful: Vec<FittedEffect>) -> Vec<Asked> {
        if doubtful.is_empty() {
            return Vec::new();
        }
        let mut own = self.chosen.after.model.limb(limb.joints());
        let local = |friction: &FittedEffect| {
            let place = (limb.joints().iter()).position(|joint| *joint == friction.joint);
            friction.on(Joint::at(place.expect("it is on the limb")))
        };
        let is_sure =
            |effect: &FittedEffect| !doubtful.iter().any(|new| local(new).excludes(effect));
        own.effects.retain(is_sure);
        let trial = Comparison::of(&self.problem, limb).short(&own);
        let with = |friction: &[FittedEffect]| {
            let all = own
                .effects
                .iter()
                .cloned()
                .chain(friction.iter().map(local));
            estimate(&trial, &own.with_effects(all.collect())).ok()
        };
        let settings = &self.problem.settings.establish;
        loop {
            let Some(fitted) = with(&doubtful) else {
                return Vec::new();
            };
            let shown = |k: usize| {
                let mut others = doubtful.clone();
                others.remove(k);
                let p = p_value(&trial, &fitted, own.effects.len() + k);
                let gain = with(&others).map(|less| 1.0 - fitted.loss() / less.loss());
                match (gain, p) {
                    (Some(gain), Some(p)) if p < settings.uncorrected_false_alarm => (gain, p),
                    _ => (0.0, 1.0),
                }
            };
            let shown = (0..doubtful.len()).into_par_iter().map(shown);
            let shown: Vec<(f64, f64)> = shown.collect();
            let least = (0..shown.len()).min_by(|a, b| shown[*a].0.total_cmp(&shown[*b].0));
            match least {
                Some(least) if shown[least].0 < settings.worthwhile_gain => {
                    doubtful.remove(least);
                }
                _ => return doubtful.into_iter().zip(shown).collect(),
            }
        }
    }

    /// Establish friction in the chosen set, if it can be fitted with it.
    fn add(&mut self, asked: &[Asked]) {
        let (problem, chosen) = (&self.problem, &mut self.chosen);
        let before = chosen.after.model.effects.clone();
        let is_new = |(friction, _): &&Asked| !before.iter().any(|own| own.excludes(friction));
        let new = asked.iter().filter(is_new);
        let effects = before
            .iter()
            .chain(new.map(|(friction, _)| friction))
            .cloned()
            .collect();
        let Ok(after) = problem.with_effects(&chosen.after, effects) else {
            return;
        };
        let without = std::mem::replace(&mut chosen.after, after);
        for (friction, shown) in asked {
            let is_it = |own: &&FittedEffect| own.is_same(friction);
            let Some(effect) = chosen.after.model.effects.iter().find(is_it) else {
                continue;
            };
            let sure = Standing::sure(effect.clone(), *shown, Ok(without.clone()));
            match chosen
                .standings
                .iter_mut()
                .find(|standing| standing.effect.is_same(friction))
            {
                Some(standing) => {
                    *standing = Standing {
                        without: standing.without.clone(),
                        ..sure
                    }
                }
                None => chosen.standings.push(sure),
            }
        }
        mark(&mut chosen.after.model, &chosen.standings);
    }
}
