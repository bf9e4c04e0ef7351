use nalgebra::DVector;
use rayon::prelude::*;

use super::folds::{Folds, losses_by, steps_without};
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::space::Space;
use crate::data::Joint;
use crate::identify::{Values, Window, huber};
use crate::model::FittedEffect;

/// The losses of a model on stretches left out of its fit: `[stretch * parts + part]`, where in a motion all joints are one
/// part, since each moves the others, and of torques each joint is one. What an effect on one of many joints is worth shows on
/// that joint.
#[derive(Debug, Clone)]
pub struct Losses {
    parts: usize,
    pub values: Vec<f64>,
}

impl Losses {
    /// On stretches that are left out in the problem's folds.
    pub fn of(problem: &Problem<'_>, fitted: &Fitted) -> Self {
        Self::by(problem, &Folds::of(problem), fitted)
    }

    /// The same with given folds.
    pub fn by(problem: &Problem<'_>, folds: &Folds, fitted: &Fitted) -> Self {
        let parts = problem.parts();
        let values = match problem.space {
            Space::Motion => losses_by(folds, &fitted.fit),
            Space::Torque => of_torques(problem, folds, fitted, |r| huber(r / fitted.fit.scale)),
        };
        Self { parts, values }
    }

    pub fn total(&self) -> f64 {
        self.values.iter().sum()
    }

    /// Of the part that a joint belongs to, one a stretch.
    pub fn of_joint(&self, joint: Joint) -> Vec<f64> {
        self.of_parts(&[joint.index().min(self.parts - 1)])
    }

    /// Of the parts that an effect acts on, one a stretch.
    pub fn of_effect(&self, effect: &FittedEffect) -> Vec<f64> {
        let joints = effect.joints().into_iter();
        let mut parts: Vec<usize> = joints.map(|j| j.index().min(self.parts - 1)).collect();
        parts.dedup();
        self.of_parts(&parts)
    }

    fn of_parts(&self, parts: &[usize]) -> Vec<f64> {
        let stretches = self.values.chunks(self.parts);
        stretches
            .map(|of_stretch| parts.iter().map(|part| of_stretch[*part]).sum())
            .collect()
    }
}

/// A loss of the residuals of torques, summed over each stretch and joint, `[stretch * joints + joint]`, with the values that
/// the linearised fit without the stretch's group gives.
pub fn of_torques(
    problem: &Problem<'_>,
    folds: &Folds,
    fitted: &Fitted,
    loss: impl Fn(f64) -> f64 + Sync,
) -> Vec<f64> {
    let (fit, joints) = (&fitted.fit, problem.declared.joints);
    let dynamics = problem.compiled(&fitted.model);
    let values = Values::of(&dynamics, problem.logs);
    let of_group = |(group, step): (usize, &DVector<f64>)| {
        let values = values.moved(&dynamics, &fit.columns, step);
        let all = problem.shooting.windows.iter().zip(&folds.stretches);
        let own = all.filter(|(_, stretch)| folds.groups[**stretch] == group);
        let (windows, stretches): (Vec<Window>, Vec<usize>) = own.unzip();
        let shooting = problem.shooting.over(windows);
        let residuals = shooting.residuals(&dynamics, &values, &shooting.initial_locals(0));
        let of_window = |(residuals, stretch): (Vec<f64>, usize)| {
            let sum = |j: usize| {
                residuals
                    .iter()
                    .skip(j)
                    .step_by(joints)
                    .map(|r| loss(*r))
                    .sum()
            };
            let losses: Vec<f64> = (0..joints).map(sum).collect();
            (stretch, losses)
        };
        let windows = residuals.into_iter().zip(stretches);
        windows.map(of_window).collect::<Vec<_>>()
    };
    let steps = steps_without(folds, fit);
    let groups: Vec<_> = steps.par_iter().enumerate().map(of_group).collect();
    let mut sums = vec![0.0; folds.groups.len() * joints];
    for (stretch, losses) in groups.into_iter().flatten() {
        let own = &mut sums[stretch * joints..][..joints];
        own.iter_mut()
            .zip(losses)
            .for_each(|(sum, loss)| *sum += loss);
    }
    sums
}
