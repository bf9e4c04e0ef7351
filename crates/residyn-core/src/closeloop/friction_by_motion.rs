//! Stage 5, at its end: friction that the torques of drives' laws leave out, where the motion under the commands asks for it.
//!
//! In torques, a limit that falls with speed and a delay that is a little too long look like viscous friction, and the search
//! takes whichever it meets first. Each moves the machine in another way.

use rayon::prelude::*;

use super::by_motion::{Comparison, estimate};
use super::establish::Standing;
use super::fitted::Fitted;
use super::judge::{Found, mark};
use super::limbs::Limb;
use super::problem::Problem;
use super::select::{baseline_friction, p_value};
use crate::model::{FittedEffect, Model};

/// A friction of the whole's, and how it shows in the motion: by how much the loss falls, and the probability of its value.
type Asked = (FittedEffect, (f64, f64));

/// The evidence of a friction, and the fit without it; none of either if its value is not significant.
struct Shown {
    evidence: (f64, f64),
    without: Option<Fitted>,
}

const NOTHING: Shown = Shown {
    evidence: (0.0, 1.0),
    without: None,
};

impl Found<'_> {
    /// Add the friction that most machines have to joints on which it is not established, wherever the motion is fitted
    /// better by a share that is of use.
    pub(super) fn add_friction_by_motion(&mut self, limbs: &[Limb]) {
        let doubtful = self.doubtful_friction();
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
        let local: Vec<FittedEffect> =
            (doubtful.iter().map(|friction| limb.of_limb(friction))).collect();
        (sure.effects).retain(|known| !local.iter().any(|friction| friction.excludes(known)));
        let trial = Comparison::of(&self.problem, limb).short(&sure);
        let asked = Friction { trial, sure }.asked(local).unwrap_or_default();
        let asked = asked.into_iter();
        asked
            .map(|(friction, evidence)| (limb.of_whole(&friction), evidence))
            .collect()
    }

    /// Establish friction in the chosen set, if it can be fitted with it.
    fn add(&mut self, asked: &[Asked]) {
        if asked.is_empty() {
            return;
        }
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
            let sure = Standing {
                gain_by_motion: Some(shown.0),
                ..Standing::sure(effect.clone(), *shown, Ok(without.clone()))
            };
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
    /// Of the friction in doubt, what the motion asks for: all without which the loss would rise. `None` if it cannot be
    /// fitted, or if all of it together says little.
    fn asked(&self, mut doubtful: Vec<FittedEffect>) -> Option<Vec<Asked>> {
        let worthwhile = self.trial.settings.establish.worthwhile_gain;
        let (all, none) = rayon::join(|| self.with(&doubtful), || self.with(&[]));
        let (mut with, none) = (all?, none?);
        if fall(&with, &none) < worthwhile {
            return None;
        }
        let significant = self.significant(&with, &doubtful);
        if significant.len() < doubtful.len() {
            (with, doubtful) = (self.with(&significant)?, significant);
        }
        loop {
            let of_each = (0..doubtful.len()).into_par_iter();
            let of_each = of_each.map(|k| self.shown(&with, &none, &doubtful, k));
            let mut shown: Vec<Shown> = of_each.collect();
            let gain = |k: &usize| shown[*k].evidence.0;
            let least = (0..shown.len()).min_by(|a, b| gain(a).total_cmp(&gain(b)));
            let Some(least) = least.filter(|least| gain(least) < worthwhile) else {
                let evidence = shown.into_iter().map(|shown| shown.evidence);
                return Some(doubtful.into_iter().zip(evidence).collect());
            };
            doubtful.remove(least);
            with = match shown.swap_remove(least).without {
                Some(without) => without,
                None => self.with(&doubtful)?,
            };
        }
    }

    /// Those of the frictions that a model is fitted with whose values are significant.
    fn significant(&self, with: &Fitted, friction: &[FittedEffect]) -> Vec<FittedEffect> {
        let places = friction.iter().enumerate();
        let significant = places.filter(|(k, _)| self.p_value(with, *k).is_some());
        significant.map(|(_, friction)| friction.clone()).collect()
    }

    /// The model with such friction, after a short fit to the motion.
    fn with(&self, friction: &[FittedEffect]) -> Option<Fitted> {
        let effects = [&self.sure.effects, friction].concat();
        estimate(&self.trial, &self.sure.with_effects(effects)).ok()
    }

    /// How the k-th friction shows in the motion.
    fn shown(&self, with: &Fitted, none: &Fitted, friction: &[FittedEffect], k: usize) -> Shown {
        let Some(p) = self.p_value(with, k) else {
            return NOTHING;
        };
        let others = [&friction[..k], &friction[k + 1..]].concat();
        let without = match others.is_empty() {
            true => Some(none.clone()),
            false => self.with(&others),
        };
        let of = |without: Fitted| Shown {
            evidence: (fall(with, &without), p),
            without: Some(without),
        };
        without.map_or(NOTHING, of)
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
