use std::f64::consts::PI;

use rand::{Rng, RngExt};

use super::predictions::difference;
use super::{ReferenceModel, Samples};
use residyn_core::model::Dynamics;

/// Number of sample points.
const POINTS: usize = 256;
/// Length of the rollout, in s.
const ROLLOUT_S: f64 = 5.0;
/// Largest number of steps of the rollout.
const ROLLOUT_STEPS: f64 = 5000.0;
/// Steps of the rollout over which a torque stays constant.
const HOLD: usize = 5;
/// Range of the rollout's torques and start velocities, relative to that of the points.
const ROLLOUT_RANGE: f64 = 0.1;
/// Number of candidate rollouts; the one least sensitive to its start is taken: in chaotic motion, two clients differ
/// only by their rounding.
const ROLLOUTS: usize = 16;
/// Change of the start by which the sensitivity is measured, relative to the range of the points.
const PERTURBATION: f64 = 1e-6;

/// Draw sample points for a model; `prismatic` says which joints slide. Positions span a whole turn (or a metre either
/// way), velocities as much per second, states of effects as much as they do along a rollout, and torques change the
/// accelerations about as much as the state does.
pub(crate) fn draw(model: &ReferenceModel, prismatic: &[bool], rng: &mut impl Rng) -> Samples {
    let n = prismatic.len();
    let motion: Vec<f64> = (0..2 * n)
        .map(|k| if prismatic[k % n] { 1.0 } else { PI })
        .collect();
    let internal = model.whole.internal_starts(&model.whole.values());
    let at_rest = |motion: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let states = motion.iter().map(|motion| [motion, internal.as_slice()]);
        states.map(|state| state.concat()).collect()
    };
    let points = rows(POINTS, &motion, rng);
    let torque = torque_range(&model.whole, &at_rest(&points));
    let held = held_torques(model.step_s, &scaled(&torque), rng);
    let slow = [&motion[..n], &scaled(&motion[n..])].concat();
    let starts = at_rest(&rows(ROLLOUTS, &slow, rng));
    let internal = internal_range(model, &starts[0], &held);
    let states = with_internal(points, &internal, rng);
    let range = [motion, internal].concat();
    let start = least_sensitive(model, starts, &range, &held);
    Samples {
        joints: n,
        step_s: model.step_s,
        torques: rows(POINTS, &torque, rng),
        start,
        held,
        states,
    }
}

/// By how much each state of an effect moves along a rollout; 1 if it does not move.
fn internal_range(model: &ReferenceModel, start: &[f64], held: &[Vec<f64>]) -> Vec<f64> {
    let rollout = model.rollout(start, held);
    let largest = |k: usize| {
        let moved = rollout.iter().map(|state| (state[k] - start[k]).abs());
        let largest = moved.filter(|moved| moved.is_finite()).fold(0.0, f64::max);
        if largest > 0.0 { largest } else { 1.0 }
    };
    let layout = model.whole.layout();
    layout.internal().map(largest).collect()
}

/// Points of the motion with states of effects.
fn with_internal(motion: Vec<Vec<f64>>, range: &[f64], rng: &mut impl Rng) -> Vec<Vec<f64>> {
    let internal = rows(motion.len(), range, rng);
    let both = motion.into_iter().zip(internal);
    both.map(|(motion, internal)| [motion, internal].concat())
        .collect()
}

/// Length of the rollout in steps of this length, in s.
pub fn rollout_s(step_s: f64) -> f64 {
    ROLLOUT_S.min(ROLLOUT_STEPS * step_s)
}

fn scaled(range: &[f64]) -> Vec<f64> {
    range.iter().map(|x| ROLLOUT_RANGE * x).collect()
}

fn held_torques(step_s: f64, range: &[f64], rng: &mut impl Rng) -> Vec<Vec<f64>> {
    let steps = (rollout_s(step_s) / step_s).ceil().max(1.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few thousand
    let steps = steps as usize;
    let pieces = rows(steps.div_ceil(HOLD), range, rng);
    (0..steps).map(|k| pieces[k / HOLD].clone()).collect()
}

/// The start whose rollout is least changed by a small change of the start.
fn least_sensitive(
    model: &ReferenceModel,
    mut starts: Vec<Vec<f64>>,
    range: &[f64],
    held: &[Vec<f64>],
) -> Vec<f64> {
    let sensitivity = |start: &Vec<f64>| {
        let pairs = start.iter().zip(range);
        let perturbed: Vec<f64> = pairs.map(|(x, range)| x + PERTURBATION * range).collect();
        let [there, here] = [&perturbed, start].map(|start| model.rollout(start, held));
        difference(&here, &there)
    };
    let sensitivities = starts.iter().map(sensitivity).enumerate();
    let (least, _) = sensitivities
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .expect("there are candidates");
    starts.swap_remove(least)
}

/// Rows of numbers, each uniform within plus and minus its column's `range`.
fn rows(count: usize, range: &[f64], rng: &mut impl Rng) -> Vec<Vec<f64>> {
    let mut row = || {
        let numbers = range
            .iter()
            .map(|range| range * rng.random_range(-1.0..=1.0));
        numbers.map(single).collect()
    };
    (0..count).map(|_| row()).collect()
}

#[allow(clippy::cast_possible_truncation)] // rounds to single precision
fn single(number: f64) -> f64 {
    f64::from(number as f32)
}

/// For each joint the torque that changes its acceleration as much as the state does without torque (root mean square);
/// 1 if nothing accelerates, or the torque has no effect.
fn torque_range(whole: &Dynamics, states: &[Vec<f64>]) -> Vec<f64> {
    let n = whole.joints;
    let values = whole.values();
    let rates = |state: &[f64], tau: &[f64]| whole.rates(state, tau, &values);
    let of_joint = |joint: usize| {
        let mut unit = vec![0.0; n];
        let (mut free, mut driven) = (0.0, 0.0);
        for state in states {
            unit[joint] = 0.0;
            let without = rates(state, &unit)[n + joint];
            unit[joint] = 1.0;
            free += without.powi(2);
            driven += (rates(state, &unit)[n + joint] - without).powi(2);
        }
        let range = (free / driven).sqrt();
        if range.is_finite() && range > 0.0 {
            range
        } else {
            1.0
        }
    };
    (0..n).map(of_joint).collect()
}
