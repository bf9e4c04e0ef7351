//! Stage 7, at its end: joints that the model file says are built alike share the values of their effects, unless the logs
//! contradict.

use rayon::prelude::*;

use super::by_motion::Comparison;
use super::limbs::Limb;
use super::problem::Problem;
use super::refine::{Refined, with_intervals};
use crate::data::Joint;
use crate::identify::uncertainty;
use crate::model::{AlikeOn, FittedEffect, Model};

/// Values differ if one is this many standard deviations from the mean of the others: one in 400 is, by chance.
const CONTRADICTS: f64 = 3.0;
/// Half widths of intervals in standard deviations.
const HALF_WIDTH: f64 = 1.96;

/// A value that like joints share.
struct Shared {
    /// The effect's name, and which of its parameters.
    effect: String,
    parameter: usize,
    joints: Vec<Joint>,
    value: f64,
    half_width: f64,
}

/// A joint's value, with the standard deviation of its estimate.
#[derive(Clone, Copy)]
struct Own {
    joint: Joint,
    value: f64,
    deviation: f64,
}

impl Refined<'_> {
    /// Share the values of effects among the joints that the file says are alike, as far as their intervals agree, and
    /// estimate all others again beside them. Values that contradict the others stay: they are findings.
    pub(super) fn tie(&mut self) {
        let groups = self.problem.declared.like.clone().unwrap_or_default();
        let shared = shared(&self.after.model, &groups);
        if shared.is_empty() || self.failure.is_some() {
            return;
        }
        let joints: Vec<Joint> = Joint::all(self.problem.declared.joints).collect();
        let (problem, free) = (&self.problem, &self.after.model);
        let Some(mut tied) = beside(problem, free, &shared, &joints) else {
            return;
        };
        let limbs: Vec<Limb> = (self.by_motion.iter())
            .map(|joints| Limb::of(problem, &[], joints.clone()))
            .collect();
        let found = limbs.par_iter().map(|limb| {
            let own = free.limb(limb.joints());
            let fine = Comparison::of(problem, limb).fine(&own);
            beside(&fine, &own, &shared, limb.joints())
        });
        let found: Vec<Option<Model>> = found.collect();
        for (limb, found) in limbs.iter().zip(found) {
            if let Some(found) = found {
                limb.put_into(&mut tied, &found);
            }
        }
        self.after.model = tied;
    }
}

/// A model of these joints with the shared values, and all others estimated beside them.
fn beside(
    problem: &Problem<'_>,
    free: &Model,
    shared: &[Shared],
    joints: &[Joint],
) -> Option<Model> {
    let places = |k: usize, effect: &FittedEffect| {
        let own = shared.iter().filter(|shared| shared.is_of(effect, joints));
        own.map(move |shared| (k, shared)).collect::<Vec<_>>()
    };
    let effects = free.effects.iter().enumerate();
    let places: Vec<(usize, &Shared)> = effects.flat_map(|(k, own)| places(k, own)).collect();
    let put_into = |model: &mut Model| {
        for (k, shared) in &places {
            let (value, half) = (shared.value, shared.half_width);
            model.effects[*k].values[shared.parameter] =
                (value, Some([value - half, value + half]));
        }
    };
    let mut start = free.clone();
    put_into(&mut start);
    let held = places
        .iter()
        .map(|(k, shared)| free.place_of(*k).start + shared.parameter);
    let problem = Problem {
        held: problem.held.iter().copied().chain(held).collect(),
        ..problem.clone()
    };
    let start_states = problem.shooting.initial_start_states(0);
    let found = problem.refit(&start, start_states, None).ok()?;
    let uncertainty = uncertainty(&problem.shooting, &found.fit);
    let mut model = with_intervals(&problem, &found, &uncertainty, free);
    put_into(&mut model);
    Some(model)
}

impl Shared {
    /// Whether an effect on one of these joints has the value.
    fn is_of(&self, effect: &FittedEffect, joints: &[Joint]) -> bool {
        self.effect == effect.effect.name && self.joints.contains(&joints[effect.joint])
    }
}

/// The values that joints of a group share: of every effect that belongs to how they are built.
fn shared(model: &Model, groups: &[Vec<Joint>]) -> Vec<Shared> {
    let mut all = Vec::new();
    for group in groups {
        let of_group = model
            .effects
            .iter()
            .filter(|own| group.contains(&own.joint));
        let of_build: Vec<&FittedEffect> = of_group
            .filter(|own| own.effect.alike_on != AlikeOn::None && !own.fixed)
            .collect();
        let mut names: Vec<&str> = of_build
            .iter()
            .map(|own| own.effect.name.as_str())
            .collect();
        names.sort_unstable();
        names.dedup();
        for name in names {
            let same = of_build.iter().filter(|own| own.effect.name == name);
            let same: Vec<&&FittedEffect> = same.collect();
            for parameter in 0..same[0].values.len() {
                let own = same.iter().filter_map(|effect| own_of(effect, parameter));
                all.extend(Shared::of(name, parameter, own.collect()));
            }
        }
    }
    all
}

/// The estimate of a parameter on its joint, if it was free.
fn own_of(effect: &FittedEffect, parameter: usize) -> Option<Own> {
    let (value, interval) = effect.values[parameter];
    let [low, high] = interval?;
    Some(Own {
        joint: effect.joint,
        value,
        deviation: (high - low) / (2.0 * HALF_WIDTH),
    })
}

impl Shared {
    /// The mean of those that do not contradict each other, if there are two or more.
    fn of(effect: &str, parameter: usize, mut own: Vec<Own>) -> Option<Self> {
        own.retain(|own| own.deviation.is_finite() && own.deviation > 0.0);
        while own.len() > 1 {
            let distance = |k: usize| {
                let others: Vec<Own> = [&own[..k], &own[k + 1..]].concat();
                let (mean, deviation) = mean(&others);
                (own[k].value - mean).abs() / own[k].deviation.hypot(deviation)
            };
            let distances: Vec<f64> = (0..own.len()).map(distance).collect();
            let farthest = (0..own.len()).max_by(|a, b| distances[*a].total_cmp(&distances[*b]))?;
            if distances[farthest] < CONTRADICTS {
                let (value, deviation) = mean(&own);
                return Some(Self {
                    effect: effect.to_owned(),
                    parameter,
                    joints: own.iter().map(|own| own.joint).collect(),
                    value,
                    half_width: HALF_WIDTH * deviation,
                });
            }
            own.remove(farthest);
        }
        None
    }
}

/// The mean with the weight of each estimate, and its standard deviation.
fn mean(own: &[Own]) -> (f64, f64) {
    let weight = |own: &Own| own.deviation.powi(-2);
    let all: f64 = own.iter().map(weight).sum();
    let sum: f64 = own.iter().map(|own| weight(own) * own.value).sum();
    (sum / all, all.sqrt().recip())
}

#[cfg(test)]
mod tests {
    use super::{Own, Shared};
    use crate::data::Joint;

    fn own(values: &[(f64, f64)]) -> Vec<Own> {
        let all = values.iter().enumerate();
        all.map(|(k, (value, deviation))| Own {
            joint: Joint::at(k),
            value: *value,
            deviation: *deviation,
        })
        .collect()
    }

    #[test]
    fn values_that_agree_are_shared_and_one_that_does_not_is_its_own() {
        let of = |values: &[(f64, f64)]| {
            let found = Shared::of("coulomb_friction", 0, own(values))?;
            let joints: Vec<usize> = found.joints.iter().map(|joint| joint.number()).collect();
            Some((joints, found.value))
        };
        let (joints, value) =
            of(&[(0.30, 0.01), (0.31, 0.01), (0.55, 0.02), (0.305, 0.01)]).unwrap();
        assert_eq!(joints, [1, 2, 4]);
        assert!((value - 0.305).abs() < 1e-12);
        // The better estimate counts for more.
        let (_, value) = of(&[(0.30, 0.01), (0.33, 0.02)]).unwrap();
        assert!((value - 0.306).abs() < 1e-12, "{value}");
        assert!(of(&[(0.30, 0.01), (0.40, 0.01)]).is_none());
        assert!(of(&[(0.30, 0.01)]).is_none());
    }
}
