//! Stage 5, at its end: friction that the torques of drives' laws leave out, where the motion under the commands asks for it.
//!
//! In torques, a limit that falls with speed and a delay that is a little too long look like viscous friction, and the search
//! takes whichever it meets first. Each moves the machine in another way.

use rayon::prelude::*;

use super::by_motion::{Comparison, by_limbs, estimate};
use super::establish::Standing;
use super::fitted::Fitted;
use super::judge::{Found, mark};
use super::limbs::Limb;
use super::problem::Problem;
use super::select::{baseline_friction, p_value};
use crate::data::Joint;
use crate::model::{FittedEffect, Model};

/// A friction of the whole's, and how it shows in the motion: by how much the loss falls, and the probability of its value.
type Asked = (FittedEffect, (f64, f64));

/// No evidence.
const NONE: (f64, f64) = (0.0, 1.0);

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
        let present = &self.chosen.after.model.effects;
        let mut friction = baseline_friction(&self.problem);
        friction.retain(|new| {
            let is_part = present.iter().any(|known| known.contains(new));
            !is_part && !self.chosen.named().any(|known| known.excludes(new))
        });
        friction
    }

    /// The friction that the motion of a limb asks for.
    fn asked(&self, limb: &Limb, doubtful: Vec<FittedEffect>) -> Vec<Asked> {
        if doubtful.is_empty() {
            return Vec::new();
        }
        let mut sure = self.chosen.after.model.limb(limb.joints());
        let place = |joint: Joint| limb.joints().iter().position(|own| *own == joint);
        let local = |friction: &FittedEffect| {
            friction.on(Joint::at(place(friction.joint).expect("it is on the limb")))
        };
        let local: Vec<FittedEffect> = doubtful.iter().map(local).collect();
        (sure.effects).retain(|known| !local.iter().any(|friction| friction.excludes(known)));
        let trial = Comparison::of(&self.problem, limb).short(&sure);
        let asked = Friction { trial, sure }.asked(local);
        let of_whole =
            |(friction, shown): Asked| (friction.on(limb.joints()[friction.joint]), shown);
        asked.into_iter().map(of_whole).collect()
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

/// The motion of a limb, and its model without the friction that is in doubt.
struct Friction<'l> {
    trial: Problem<'l>,
    sure: Model,
}

impl Friction<'_> {
    /// Of the friction in doubt, what the motion asks for: all without which the loss would rise.
    fn asked(&self, mut doubtful: Vec<FittedEffect>) -> Vec<Asked> {
        let worthwhile = self.trial.settings.establish.worthwhile_gain;
        let (all, none) = rayon::join(|| self.with(&doubtful), || self.with(&[]));
        let (Some(all), Some(none)) = (all, none) else {
            return Vec::new();
        };
        if fall(&all, &none) < worthwhile {
            return Vec::new();
        }
        let mut place = 0..;
        doubtful.retain(|_| {
            self.p_value(&all, place.next().expect("there are numbers for all"))
                .is_some()
        });
        loop {
            let Some(with) = self.with(&doubtful) else {
                return Vec::new();
            };
            let shown = |k: usize| self.shown(&with, &doubtful, k);
            let shown: Vec<(f64, f64)> = (0..doubtful.len()).into_par_iter().map(shown).collect();
            let least = (0..shown.len()).min_by(|a, b| shown[*a].0.total_cmp(&shown[*b].0));
            match least.filter(|least| shown[*least].0 < worthwhile) {
                Some(least) => doubtful.remove(least),
                None => return doubtful.into_iter().zip(shown).collect(),
            };
        }
    }

    /// The model with such friction, after a short fit to the motion.
    fn with(&self, friction: &[FittedEffect]) -> Option<Fitted> {
        let effects = [&self.sure.effects, friction].concat();
        estimate(&self.trial, &self.sure.with_effects(effects)).ok()
    }

    /// How the k-th friction shows in the motion.
    fn shown(&self, with: &Fitted, friction: &[FittedEffect], k: usize) -> (f64, f64) {
        let mut others = friction.to_vec();
        others.remove(k);
        let Some(p) = self.p_value(with, k) else {
            return NONE;
        };
        self.with(&others)
            .map_or(NONE, |without| (fall(with, &without), p))
    }

    /// The probability of the value of the k-th friction, if it is significant.
    fn p_value(&self, with: &Fitted, k: usize) -> Option<f64> {
        let level = self.trial.settings.establish.uncorrected_false_alarm;
        p_value(&self.trial, with, self.sure.effects.len() + k).filter(|p| *p < level)
    }
}

/// By which share the loss falls.
fn fall(with: &Fitted, without: &Fitted) -> f64 {
    1.0 - with.loss() / without.loss()
}
