use nalgebra::DVector;
use rayon::prelude::*;

use super::folds::{Folds, left_out_losses, steps_without};
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::data::Joint;
use crate::identify::{Values, Window, huber};
use crate::model::{Dynamics, FittedEffect};

/// The losses of a model on blocks left out of its fit: `[block * parts + part]`. For motion all joints are one part,
/// since each moves the others; for torques each joint is a part. The gain of an effect on one of many joints shows on
/// that joint.
#[derive(Debug, Clone)]
pub struct Losses {
    parts: usize,
    pub values: Vec<f64>,
}

impl Losses {
    /// On blocks left out in the problem's folds.
    pub fn of(problem: &Problem<'_>, fitted: &Fitted) -> Self {
        Self::by(problem, &Folds::of(problem), fitted)
    }

    /// As [`Losses::of`], with given folds.
    pub fn by(problem: &Problem<'_>, folds: &Folds, fitted: &Fitted) -> Self {
        let parts = problem.parts();
        let values = match problem.error_model {
            ErrorModel::OutputError => left_out_losses(folds, &fitted.fit),
            ErrorModel::InverseDynamics => {
                of_torques(problem, folds, fitted, |r| huber(r / fitted.fit.scale))
            }
        };
        Self { parts, values }
    }

    pub fn total(&self) -> f64 {
        self.values.iter().sum()
    }

    /// The losses of the part that a joint belongs to, one a block.
    pub fn of_joint(&self, joint: Joint) -> Vec<f64> {
        self.of_parts(&[joint.index().min(self.parts - 1)])
    }

    /// The losses of the parts that an effect acts on, one a block.
    pub fn of_effect(&self, effect: &FittedEffect) -> Vec<f64> {
        let joints = effect.joints().into_iter();
        let mut parts: Vec<usize> = joints.map(|j| j.index().min(self.parts - 1)).collect();
        parts.dedup();
        self.of_parts(&parts)
    }

    fn of_parts(&self, parts: &[usize]) -> Vec<f64> {
        let sum = |of_block: &[f64]| parts.iter().map(|part| of_block[*part]).sum();
        self.values.chunks(self.parts).map(sum).collect()
    }
}

/// A loss of the torque residuals, summed over each block and joint, `[block * joints + joint]`, with the values that
/// the linearised fit without the block's group gives.
pub fn of_torques(
    problem: &Problem<'_>,
    folds: &Folds,
    fitted: &Fitted,
    loss: impl Fn(f64) -> f64 + Sync,
) -> Vec<f64> {
    let joints = problem.declared.joints;
    let of_group = |group: usize, dynamics: &Dynamics, values: &Values| {
        let all = problem.shooting.windows.iter().zip(&folds.blocks);
        let own = all.filter(|(_, block)| folds.groups[**block] == group);
        let (windows, blocks): (Vec<Window>, Vec<usize>) = own.unzip();
        let shooting = problem.shooting.over(windows);
        let residuals = shooting.residuals(dynamics, values, &shooting.initial_start_states(0));
        let of_window = |(residuals, block): (Vec<f64>, usize)| {
            let of_joint = |j: usize| {
                let own = residuals.iter().skip(j).step_by(joints);
                (block * joints + j, own.map(|r| loss(*r)).sum::<f64>())
            };
            (0..joints).map(of_joint).collect::<Vec<_>>()
        };
        let windows = residuals.into_iter().zip(blocks);
        windows.flat_map(of_window).collect()
    };
    left_out_sums(problem, folds, fitted, joints, of_group)
}

/// Sums `[block * parts + part]` of what `of_group` gives for each group of blocks, as place and summand, with the model
/// and the values that the linearised fit without the group gives.
pub fn left_out_sums(
    problem: &Problem<'_>,
    folds: &Folds,
    fitted: &Fitted,
    parts: usize,
    of_group: impl Fn(usize, &Dynamics, &Values) -> Vec<(usize, f64)> + Sync,
) -> Vec<f64> {
    let dynamics = problem.compiled(&fitted.model);
    let values = Values::of(&dynamics, problem.logs);
    let of_group = |(group, step): (usize, &DVector<f64>)| {
        let there = values.moved(&dynamics, &fitted.fit.columns, step);
        of_group(group, &dynamics, &there)
    };
    let steps = steps_without(folds, &fitted.fit);
    let groups: Vec<_> = steps.par_iter().enumerate().map(of_group).collect();
    let mut sums = vec![0.0; folds.groups.len() * parts];
    for (place, summand) in groups.into_iter().flatten() {
        sums[place] += summand;
    }
    sums
}
