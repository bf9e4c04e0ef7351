//! Stage 5, at its end: names that the torques of drives' laws leave in doubt, decided by the motion under the commands.
//!
//! Torques tell Stribeck friction from dry friction, or a limit that falls with speed from one that does not, by what a
//! low-pass filter leaves of reversals and peaks. The motion tells by the whole. So where joints that are alike have another
//! effect, or a simpler one would do, both are fitted to the motion, from where the torques ended.

use rayon::prelude::*;

use super::alike::usual;
use super::by_motion::{Comparison, estimate};
use super::establish::Standing;
use super::judge::{Found, mark};
use super::limbs::Limb;
use super::plainer::Unused;
use super::select::{p_value, parts};
use crate::model::{FittedEffect, Model, Status};

/// An effect that another may replace.
#[derive(Clone)]
struct Doubt {
    /// Its place in the model of the whole.
    place: usize,
    /// On the same joint.
    instead: FittedEffect,
    is_usual: bool,
}

impl Found<'_> {
    /// Replace effects by what their joint's like have, or by a simpler one that they contain, where that predicts the
    /// motion as well.
    pub(super) fn decide_by_motion(&mut self, limbs: &[Limb]) {
        let doubts = self.doubts();
        let model = &self.chosen.after.model;
        let decided = limbs.par_iter().flat_map_iter(|limb| {
            let is_own = |doubt: &&Doubt| limb.joints().contains(&doubt.instead.joint);
            let own: Vec<Doubt> = doubts.iter().filter(is_own).cloned().collect();
            self.decided(limb, model, own)
        });
        let decided: Vec<Doubt> = decided.collect();
        self.replace(decided);
    }

    /// What may stand in place of the effects that were added.
    fn doubts(&self) -> Vec<Doubt> {
        let (problem, chosen) = (&self.problem, &self.chosen);
        let found: Vec<(FittedEffect, Status)> = (chosen.standings.iter())
            .map(|standing| (standing.effect.clone(), standing.status))
            .collect();
        let usual = usual(problem.declared, &found);
        let present = &chosen.after.model.effects;
        let is_free = |new: &FittedEffect| !present.iter().any(|present| present.excludes(new));
        let of_effect = |place: usize| {
            let own = &present[place];
            let like = usual.iter().filter(|new| new.replaces(own, &usual));
            let like = like.map(|usual| usual.effect.on(own.joint));
            let as_good = like.chain(parts(problem, own));
            let mut doubts: Vec<Doubt> = Vec::new();
            for instead in as_good {
                let is_new = !doubts.iter().any(|known| known.instead.is_same(&instead));
                if is_new && is_free(&instead) {
                    doubts.push(Doubt {
                        place,
                        is_usual: usual.iter().any(|usual| usual.is_of(&instead)),
                        instead,
                    });
                }
            }
            doubts
        };
        problem
            .added(&chosen.after.model)
            .flat_map(of_effect)
            .collect()
    }

    /// The doubts in which the motion of a limb is predicted as well by the other effect.
    fn decided(&self, limb: &Limb, model: &Model, doubts: Vec<Doubt>) -> Vec<Doubt> {
        let place = |of_whole: usize| {
            let before = model.effects[..of_whole].iter();
            before
                .filter(|effect| limb.joints().contains(&effect.joint))
                .count()
        };
        if doubts.is_empty() {
            return doubts;
        }
        let own = model.limb(limb.joints());
        let trial = Comparison::of(&self.problem, limb).short(&own);
        let Ok(first) = estimate(&trial, &own) else {
            return Vec::new();
        };
        let (mut least, mut best) = (first.loss(), first.model);
        let negligible = self.problem.settings.select.negligible_rise;
        let mut decided: Vec<Doubt> = Vec::new();
        for doubt in doubts {
            if decided.iter().any(|known| known.place == doubt.place) {
                continue;
            }
            let mut other = best.clone();
            other.effects[place(doubt.place)] = limb.of_limb(&doubt.instead);
            let Ok(other) = estimate(&trial, &other) else {
                continue;
            };
            if other.loss() < least * (1.0 + negligible) {
                (least, best) = (other.loss(), other.model);
                decided.push(doubt);
            }
        }
        decided
    }

    /// Put the other effects into the chosen set, if it can be fitted with them.
    fn replace(&mut self, decided: Vec<Doubt>) {
        let (problem, chosen) = (&self.problem, &mut self.chosen);
        let mut effects = chosen.after.model.effects.clone();
        for doubt in &decided {
            effects[doubt.place] = doubt.instead.clone();
        }
        if decided.is_empty() {
            return;
        }
        let Ok(after) = problem.with_effects(&chosen.after, effects) else {
            return;
        };
        let declared = problem.declared.effects.len();
        let level = problem.settings.establish.uncorrected_false_alarm;
        for doubt in &decided {
            let standing: &mut Standing = &mut chosen.standings[doubt.place - declared];
            let new = &doubt.instead.effect.name;
            chosen.unused.push(Unused {
                effect: Some(standing.effect.clone()),
                why: format!("{new} predicts the motion under the commands as well"),
            });
            let is_shown = p_value(problem, &after, doubt.place).is_some_and(|p| p < level);
            standing.effect = after.model.effects[doubt.place].clone();
            if doubt.is_usual && is_shown {
                (standing.status, standing.reason) = (Status::Established, None);
            }
        }
        chosen.after = after;
        mark(&mut chosen.after.model, &chosen.standings);
    }
}
