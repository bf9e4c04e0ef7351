//! Stage 4, at its very end: what the search of one joint can learn from those of joints that are built alike.
//!
//! One bus brings the commands of all drives, and like joints have like motors and gears: what most of them have, the
//! others have too, unless the logs contradict. A joint whose own logs hardly tell a delay from a lag, or Stribeck friction
//! from dry friction, is thus named by those that do.

use rayon::prelude::*;

use super::establish::Standing;
use super::plainer::Unused;
use super::problem::Problem;
use super::searched::Searched;
use super::select::{Trial, p_value};
use super::stage::Watch;
use crate::data::{Joint, Quantity};
use crate::model::{AlikeOn, EffectParameter, FittedEffect, Model, Status};

/// A part of a rig that was searched on its own, and its joints.
pub(super) struct Part<'a> {
    pub joints: Vec<Joint>,
    pub searched: Searched<'a>,
}

/// An effect that at least half of some joints that are alike have.
pub(super) struct Usual {
    /// As the joint with the median value has it.
    pub effect: FittedEffect,
    pub joints: Vec<Joint>,
    is_of_most: bool,
}

/// Replace and add effects where like joints have others, as far as the logs do not contradict.
pub(super) fn agree(whole: &Model, parts: &mut [Part<'_>], watch: &dyn Watch) {
    let found: Vec<(FittedEffect, Status)> = parts.iter().flat_map(Part::found).collect();
    let usual = usual(whole, &found);
    if usual.is_empty() {
        return;
    }
    parts.par_iter_mut().for_each(|part| {
        if let Some(searched) = part.agreeing(&usual, watch) {
            part.searched = searched;
        }
        part.confirm(&usual);
    });
}

/// The effects that at least half of the joints that are alike have, one of them established.
pub(super) fn usual(whole: &Model, found: &[(FittedEffect, Status)]) -> Vec<Usual> {
    let like = whole.like_joints();
    let all = [Joint::all(whole.joints).collect()];
    let mut names: Vec<&str> = found
        .iter()
        .map(|(own, _)| own.effect.name.as_str())
        .collect();
    names.sort_unstable();
    names.dedup();
    let of_name = |name: &str| {
        let own = found.iter().filter(|(own, _)| own.effect.name == name);
        let own: Vec<&(FittedEffect, Status)> = own.collect();
        let groups = match own[0].0.effect.alike_on {
            AlikeOn::None => &[],
            AlikeOn::LikeJoints => like.as_slice(),
            AlikeOn::Commanded if whole.driven_by() == Quantity::Command => &all[..],
            AlikeOn::Commanded => &[],
        };
        let groups = groups.iter();
        groups
            .filter_map(|group| Usual::of(group, &own))
            .collect::<Vec<_>>()
    };
    let mut usual: Vec<Usual> = names.into_iter().flat_map(of_name).collect();
    // What more joints have comes first.
    usual.sort_by_key(|usual| std::cmp::Reverse(usual.joints.len()));
    usual
}

impl Usual {
    fn of(group: &[Joint], found: &[&(FittedEffect, Status)]) -> Option<Self> {
        let mut own = found.to_vec();
        own.retain(|(effect, _)| group.contains(&effect.joint));
        let is_sure = own.iter().any(|(_, status)| *status == Status::Established);
        if !is_sure || 2 * own.len() < group.len() || group.len() < 2 {
            return None;
        }
        own.sort_by(|(a, _), (b, _)| a.values[0].0.total_cmp(&b.values[0].0));
        Some(Self {
            effect: own[own.len() / 2].0.clone(),
            joints: group.to_vec(),
            is_of_most: 2 * own.len() > group.len(),
        })
    }

    /// Whether an effect is this one, on one of its joints.
    pub fn is_of(&self, effect: &FittedEffect) -> bool {
        self.joints.contains(&effect.joint) && self.effect.effect.name == effect.effect.name
    }

    /// Whether this effect may take the place of another that one of its joints has: the two are easily confused, and more
    /// of the joints have this one, or it is simpler; the other is not usual itself, or among fewer joints.
    pub fn replaces(&self, other: &FittedEffect, all: &[Self]) -> bool {
        let [own, their] = [&self.effect.effect, &other.effect];
        let is_simpler = own.parameters.len() < their.parameters.len();
        let mut as_usual = all
            .iter()
            .filter(|usual| usual.joints.len() >= self.joints.len());
        self.joints.contains(&other.joint)
            && own.is_confused_with(their)
            && (self.is_of_most || is_simpler)
            && !as_usual.any(|usual| usual.is_of(other))
    }
}

impl<'a> Part<'a> {
    /// The effects that were added, on joints of the whole rig.
    fn found(&self) -> Vec<(FittedEffect, Status)> {
        let standings = self.searched.chosen.standings.iter();
        let of_whole = |effect: &FittedEffect| effect.on(self.joints[effect.joint]);
        standings
            .map(|standing| (of_whole(&standing.effect), standing.status))
            .collect()
    }

    /// Those of the usual effects that concern this part, on its joints.
    fn own<'u>(&self, usual: &'u [Usual]) -> Vec<(&'u Usual, FittedEffect)> {
        let joints = self.joints.iter().enumerate();
        let own = joints.flat_map(|(k, joint)| {
            let concerns = usual.iter().filter(|usual| usual.joints.contains(joint));
            concerns.map(move |usual| (usual, usual.effect.on(Joint::at(k))))
        });
        own.collect()
    }

    /// The search with usual effects in place of others and beside them, if the logs agree.
    fn agreeing(&self, all: &[Usual], watch: &dyn Watch) -> Option<Searched<'a>> {
        let Searched {
            declared, chosen, ..
        } = &self.searched;
        let before = Trial::of(&declared.problem, chosen.after.clone());
        let (mut trial, mut unused) = (before.clone(), Vec::new());
        for (usual, effect) in &self.own(all) {
            let is_free =
                |other: &FittedEffect| usual.replaces(&other.on(self.joints[other.joint]), all);
            while let Some((better, other)) = self.instead(&trial, effect, is_free) {
                let name = &effect.effect.name;
                unused.push(Unused {
                    effect: Some(other),
                    why: format!("{name}, which like joints have, explains the logs as well"),
                });
                trial = better;
            }
            if !self.is_filtered(&trial, (usual, effect), all) {
                trial = self.with(&trial, effect).unwrap_or(trial);
            }
        }
        (trial.key() != before.key()).then(|| self.searched.with(trial, unused, watch))
    }

    /// Whether a trial has another filter of the same joint's commands that more joints have: beside it, the torques of a
    /// law show any filter.
    fn is_filtered(
        &self,
        trial: &Trial,
        (usual, effect): (&Usual, &FittedEffect),
        all: &[Usual],
    ) -> bool {
        let is_other = |own: &FittedEffect| {
            let mut of_more = all
                .iter()
                .filter(|other| other.joints.len() > usual.joints.len());
            own.joint == effect.joint
                && own.effect.is_filter()
                && of_more.any(|other| other.is_of(&own.on(self.joints[own.joint])))
        };
        effect.effect.is_filter() && trial.fitted.model.effects.iter().any(is_other)
    }

    /// The trial with a usual effect, which it may have already, in place of a free one on its joint, and that one, if the
    /// logs do not tell them apart.
    fn instead(
        &self,
        trial: &Trial,
        effect: &FittedEffect,
        is_free: impl Fn(&FittedEffect) -> bool,
    ) -> Option<(Trial, FittedEffect)> {
        let problem = &self.searched.declared.problem;
        let settings = &problem.settings.select;
        let model = &trial.fitted.model;
        let without = |k: usize| {
            let other = &model.effects[k];
            if other.joint != effect.joint || !is_free(other) {
                return None;
            }
            let mut effects = model.effects.clone();
            effects.remove(k);
            if !effects.iter().any(|present| present.excludes(effect)) {
                effects.insert(k, effect.clone());
            }
            let below = trial.loss() * (1.0 + settings.simpler_rise);
            let fitted = problem.with_better_effects(&trial.fitted, effects, below)?;
            let found = Trial::of(problem, fitted);
            let is_as_good = found.is_valid(problem) && found.is_as_good_as(trial, settings);
            is_as_good.then(|| (found, other.clone()))
        };
        problem.added(model).find_map(without)
    }

    /// The trial with a usual effect in addition, if the logs show it.
    fn with(&self, trial: &Trial, effect: &FittedEffect) -> Option<Trial> {
        let problem = &self.searched.declared.problem;
        let model = &trial.fitted.model;
        let is_there =
            |present: &FittedEffect| present.excludes(effect) || present.contains(effect);
        if model.effects.iter().any(is_there) {
            return None;
        }
        let effects = [model.effects.as_slice(), std::slice::from_ref(effect)].concat();
        let fitted = problem.with_better_effects(&trial.fitted, effects, trial.loss())?;
        let found = Trial::of(problem, fitted);
        let p_value = p_value(problem, &found.fitted, model.effects.len());
        let gain = found.gain_over(trial, effect);
        (problem.is_shown(gain, p_value) && found.is_valid(problem)).then_some(found)
    }

    /// Establish usual effects that the logs show on their own: they are not one of many candidates.
    fn confirm(&mut self, usual: &[Usual]) {
        let own = self.own(usual);
        let chosen = &mut self.searched.chosen;
        let problem = &self.searched.declared.problem;
        let shows = |standing: &Standing| {
            let mut parameters = standing.effect.effect.parameters.iter();
            let is_switched = parameters.any(EffectParameter::is_switch);
            problem.is_shown(standing.gain, is_switched.then_some(standing.p_value))
        };
        for standing in &mut chosen.standings {
            let is_usual = own
                .iter()
                .any(|(_, effect)| effect.is_same(&standing.effect));
            if is_usual && shows(standing) {
                standing.status = Status::Established;
                standing.reason = None;
            }
        }
    }
}

impl Problem<'_> {
    /// Whether the logs show a usual effect by its significance or, if no value switches it off, as with a limit, by what
    /// it gains.
    fn is_shown(&self, gain: f64, p_value: Option<f64>) -> bool {
        let settings = &self.settings.establish;
        match p_value {
            Some(p) => gain > 0.0 && p < settings.uncorrected_false_alarm,
            None => gain >= settings.worthwhile_gain,
        }
    }
}
