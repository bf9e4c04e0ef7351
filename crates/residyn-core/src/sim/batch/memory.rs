use super::Rows;
use crate::lanes::{Arch, Simd, Vector, WithSimd};
use crate::model::Dynamics;
use crate::model::to_f32;
use crate::sim::Commands;

/// Discrete impulse response of a model's torque filters for torques that are held over equal steps. The filters are
/// linear: the mean torque over a step is a weighted sum of the torques commanded in this step and the ones before.
#[derive(Debug, Clone)]
pub(super) struct Memory {
    /// `[joint][steps ago]`
    weights: Vec<Vec<f32>>,
}

/// The response is truncated where the remaining weights sum to less than this share.
const LEAST_REST: f64 = 1e-6;
/// Longest response; a command that acts later is counted in the last step.
const MOST_STEPS: usize = 4096;

impl Memory {
    /// The response of the filters of `equations`; none without filters.
    pub fn new(equations: &Dynamics, step_s: f64) -> Option<Self> {
        if equations.filters.is_empty() {
            return None;
        }
        // The first command counts as held for ever before, so the impulse is the second.
        let time: Vec<f64> = (0..MOST_STEPS + 2).map(|row| step_s * row as f64).collect();
        let mut impulse = vec![0.0; time.len()];
        impulse[1] = 1.0;
        let response = Commands::new(equations, &time, &vec![impulse; equations.joints]).acting();
        let weights = response.iter();
        let weights = weights.map(|tau| until_little_is_left(&tau[1..=MOST_STEPS]));
        Some(Self {
            weights: weights.collect(),
        })
    }

    /// The response of filters, if there are any, to torques that act so many steps later; none without either.
    pub fn later(filters: Option<Self>, joints: usize, steps: usize) -> Option<Self> {
        if steps == 0 {
            return filters;
        }
        let at_once = || vec![vec![1.0]; joints];
        let weights = filters.map_or_else(at_once, |filters| filters.weights);
        let later = |weights: Vec<f32>| [vec![0.0; steps], weights].concat();
        Some(Self {
            weights: weights.into_iter().map(later).collect(),
        })
    }

    /// Number of earlier steps that affect the current one.
    pub fn steps(&self) -> usize {
        let longest = self.weights.iter().map(Vec::len).max();
        longest.map_or(0, |count| count - 1)
    }

    /// The part of the acting torque that is due to torques commanded before a plan of `steps` steps: `past`
    /// (`[step][joint]`), oldest first, the oldest held for ever before. `[step * n + joint]`, up to the last step
    /// affected.
    #[allow(clippy::cast_possible_truncation)] // planning runs in f32
    pub fn carried(&self, past: &[Vec<f64>], steps: usize) -> Vec<f32> {
        let ago = |steps: usize| past.get(past.len().saturating_sub(steps));
        let of_joint = |step: usize, joint: usize| {
            let before = self.weights[joint].iter().enumerate().skip(step + 1);
            let parts = before.map(|(k, weight)| {
                let command = ago(k - step).map_or(0.0, |tau| tau[joint]);
                f64::from(*weight) * command
            });
            parts.sum::<f64>() as f32
        };
        let joints = 0..self.weights.len();
        (0..steps.min(self.steps()))
            .flat_map(|step| joints.clone().map(move |joint| (step, joint)))
            .map(|(step, joint)| of_joint(step, joint))
            .collect()
    }

    /// The mean torque over each step from the carried part and the `commanded` torques, all `[step * n + joint]`.
    pub fn act(&self, arch: Arch, carried: &[f32], commanded: &[Rows], acting: &mut Vec<Rows>) {
        acting.resize(commanded.len(), Rows::splat(0.0));
        arch.dispatch(Act {
            weights: &self.weights,
            carried,
            commanded,
            acting,
        });
    }
}

/// The truncated response. Both kinds of filters pass a constant torque unchanged, so the weights sum to 1.
fn until_little_is_left(response: &[f64]) -> Vec<f32> {
    let mut rest = 1.0;
    let mut weights = Vec::new();
    for weight in response {
        weights.push(*weight);
        rest -= weight;
        if rest.abs() < LEAST_REST {
            break;
        }
    }
    *weights.last_mut().expect("a response of some steps") += rest;
    to_f32(&weights)
}

struct Act<'a> {
    weights: &'a [Vec<f32>],
    carried: &'a [f32],
    commanded: &'a [Rows],
    acting: &'a mut [Rows],
}

impl WithSimd for Act<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let n = self.weights.len();
        for (k, acting) in self.acting.iter_mut().enumerate() {
            let carried = self.carried.get(k).copied().unwrap_or(0.0);
            let weights = &self.weights[k % n];
            for part in 0..Rows::parts::<S>() {
                let commands = self.commanded[..=k].iter().rev().step_by(n);
                let mut sum = Vector::splat(simd, carried);
                for (command, weight) in commands.zip(weights) {
                    let weight = Vector::splat(simd, *weight);
                    sum = command.get(simd, part).mul_add(weight, sum);
                }
                acting.set(part, sum);
            }
        }
    }
}
