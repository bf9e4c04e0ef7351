use std::f64::consts::PI;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::predictions::difference;
use super::reference::Prediction;
use crate::model::Dynamics;

/// Points in the space of states and torques, and a rollout. Every number is exactly an f32, so that readers in single
/// precision see the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Samples {
    pub joints: usize,
    pub step_s: f64,
    /// Rows of positions, then velocities.
    pub states: Vec<Vec<f64>>,
    /// The torque in each of them, held for a step: commanded with nothing before it, or acting, as it is asked.
    pub torques: Vec<Vec<f64>>,
    /// Where the rollout starts, at time 0 and after no torque.
    pub start: Vec<f64>,
    /// The torque commanded over each step of the rollout.
    pub held: Vec<Vec<f64>>,
}

const POINTS: usize = 256;
/// Length of the rollout, in s.
const ROLLOUT_S: f64 = 5.0;
/// Steps of the rollout for which a torque is held.
const HOLD: usize = 5;
/// The rollout's torques, and its speeds at the start, as a share of what points are drawn from.
const CALM: f64 = 0.1;
/// Of so many rollouts the one is taken that a small change of its start changes least: where a motion turns every
/// difference into another motion, two readers tell of nothing but their rounding.
const ROLLOUTS: usize = 16;
/// The change of the start, as a share of what points are drawn from.
const NUDGE: f64 = 1e-6;

impl Samples {
    /// Points over a whole turn (or a metre either way) and speeds as large per second, with torques that change the
    /// accelerations about as much as the state does.
    pub(in crate::formats) fn draw(
        model: &Prediction,
        prismatic: &[bool],
        rng: &mut impl Rng,
    ) -> Self {
        let n = prismatic.len();
        let reach = |k: usize| if prismatic[k % n] { 1.0 } else { PI };
        let reach: Vec<f64> = (0..2 * n).map(reach).collect();
        let states = rows(POINTS, &reach, rng);
        let torque = torque_scale(&model.whole, &states);
        let steps = (ROLLOUT_S / model.step_s).ceil().max(1.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a number of steps
        let steps = steps as usize;
        let calm = |scale: &[f64]| scale.iter().map(|x| CALM * x).collect::<Vec<_>>();
        let pieces = rows(steps.div_ceil(HOLD), &calm(&torque), rng);
        let held: Vec<_> = (0..steps).map(|k| pieces[k / HOLD].clone()).collect();
        let slow = [&reach[..n], &calm(&reach[n..])].concat();
        let starts = rows(ROLLOUTS, &slow, rng);
        let growth = |start: &[f64]| {
            let nudged: Vec<f64> = start
                .iter()
                .zip(&reach)
                .map(|(x, r)| x + NUDGE * r)
                .collect();
            let [there, here] = [&nudged, start].map(|start| model.rollout(start, &held));
            difference(&here, &there)
        };
        let growths = starts.iter().map(|start| growth(start));
        let calmest = growths.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let (calmest, _) = calmest.expect("there are some");
        Self {
            joints: n,
            step_s: model.step_s,
            torques: rows(POINTS, &torque, rng),
            start: starts[calmest].clone(),
            held,
            states,
        }
    }
}

/// Rows of numbers, each uniform within plus and minus its column's `reach`.
fn rows(count: usize, reach: &[f64], rng: &mut impl Rng) -> Vec<Vec<f64>> {
    let mut row = || {
        let numbers = reach
            .iter()
            .map(|reach| reach * rng.random_range(-1.0..=1.0));
        numbers.map(single).collect()
    };
    (0..count).map(|_| row()).collect()
}

#[allow(clippy::cast_possible_truncation)] // meant
fn single(number: f64) -> f64 {
    f64::from(number as f32)
}

/// For each joint the torque that changes its acceleration as much as it is without torque (root mean square); 1 where
/// nothing accelerates, or the torque does nothing.
fn torque_scale(whole: &Dynamics, states: &[Vec<f64>]) -> Vec<f64> {
    let n = whole.joints;
    let values = whole.values();
    let rates =
        |state: &[f64], tau: &[f64]| whole.program.eval(&[state, tau, &[0.0], &values].concat());
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
        let scale = (free / driven).sqrt();
        if scale.is_finite() && scale > 0.0 {
            scale
        } else {
            1.0
        }
    };
    (0..n).map(of_joint).collect()
}
