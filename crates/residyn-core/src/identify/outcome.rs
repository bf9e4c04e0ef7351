use std::fmt;

use nalgebra::DMatrix;
use serde::Serialize;
use thiserror::Error;

use super::intervals::count;
use super::normal_equations::{Reduced, WindowTerms, with_unit_diagonal};
use super::values::{Column, Values};
use crate::decomposition::eigen;

/// Why parameters could not be fitted.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FitError {
    #[error(
        "the logs contain no window to fit: every block is shorter than a window, broken by a gap or left out; record longer logs or leave out less"
    )]
    NoWindow,
    #[error(
        "with its starting values the model diverges in {diverged} of {windows} windows of the logs; give parameters closer to those of the rig in the model file"
    )]
    Diverged { diverged: usize, windows: usize },
}

/// Where some steps of a fit led.
#[derive(Debug, Clone)]
pub struct Led {
    pub values: Values,
    /// Each window's own values, as in a [`Fit`].
    pub start_states: Vec<Vec<f64>>,
    /// Sum of the losses, as in a [`Fit`].
    pub cost: f64,
}

/// The result of a fit apart from the values found: its cost, how it ended, and the normal equations there.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Which parameters were free.
    pub active: Vec<usize>,
    /// The free values: one column for each free parameter or, if it differs by log, one for each log.
    pub columns: Vec<Column>,
    /// Each window's own values: its start state, then forces if they were free.
    pub start_states: Vec<Vec<f64>>,
    /// Robust standard deviation of the normalised residuals: 1 if the model explains everything except noise.
    pub scale: f64,
    /// Sum of the losses at that scale.
    pub cost: f64,
    /// The additional cost of the values' departure from the declared ones.
    pub prior_cost: f64,
    /// What the declared values add to the normal equations, without a cost.
    pub(super) prior: WindowTerms,
    /// The bodies' part of them, with its cost: bodies are known to be near the declared ones, which counts like data.
    pub(super) bodies: WindowTerms,
    /// The normal equations of each window in the free values, its own values eliminated.
    pub reduced: Vec<Reduced>,
    /// Number of steps taken.
    pub steps: usize,
    /// The cost after each, in units of the sensors' noise: times the square of the scale at that step.
    pub trace: Vec<f64>,
    /// Why the fit ended.
    pub termination: Termination,
}

impl Fit {
    /// Which of the free values are of such a parameter.
    pub(crate) fn columns_of(&self, is_one: impl Fn(usize) -> bool) -> Vec<usize> {
        let all = 0..self.columns.len();
        all.filter(|&i| is_one(self.columns[i].parameter)).collect()
    }

    /// The same without the normal equations of each window, which are most of its memory: for models that are compared by
    /// what has been computed from them.
    #[must_use]
    pub(crate) fn without_windows(self) -> Self {
        Self {
            reduced: Vec::new(),
            ..self
        }
    }

    /// Zero normal equations in the free values.
    pub fn zero_equations(&self) -> WindowTerms {
        WindowTerms::zeros(self.columns.len())
    }

    /// Normal equations of all windows.
    pub fn equations(&self) -> WindowTerms {
        let mut all = self.zero_equations();
        for window in &self.reduced {
            window.add_to(&mut all);
        }
        all
    }

    /// The same with the prior of the declared values: the equations whose gradient is zero where the fit ended.
    pub fn equations_and_prior(&self) -> WindowTerms {
        let mut all = self.equations();
        all.gradient += &self.prior.gradient;
        all.hessian += &self.prior.hessian;
        all
    }

    /// The prior of the declared values, with its cost.
    pub fn declared_values(&self) -> WindowTerms {
        WindowTerms {
            cost: self.prior_cost,
            ..self.prior.clone()
        }
    }

    /// Information on the free values: that of the logs and, of bodies, that of their declaration.
    pub fn information(&self) -> DMatrix<f64> {
        self.equations().hessian + &self.bodies.hessian
    }

    /// Largest over smallest eigenvalue of the normal equations' matrix in the free values, as they are and in units in
    /// which each value alone has the same information; infinite if the matrix is singular, 1 without free values.
    pub fn condition(&self) -> [f64; 2] {
        let matrix = self.equations().hessian;
        let (scaled, _) = with_unit_diagonal(&matrix);
        [matrix, scaled].map(|matrix| {
            if matrix.is_empty() {
                return 1.0;
            }
            let Some(eigen) = eigen(matrix) else {
                return f64::INFINITY;
            };
            let values = eigen.eigenvalues;
            let smallest = values.iter().copied().fold(f64::INFINITY, f64::min);
            let largest = values.iter().copied().fold(0.0, f64::max);
            match smallest > 0.0 {
                true => largest / smallest,
                false => f64::INFINITY,
            }
        })
    }

    /// Normal equations of each group of windows; `groups` gives the group of each window, counted from 0.
    pub fn equations_by(&self, groups: &[usize]) -> Vec<WindowTerms> {
        let mut parts = vec![self.zero_equations(); count(groups)];
        for (window, &group) in self.reduced.iter().zip(groups) {
            window.add_to(&mut parts[group]);
        }
        parts
    }
}

/// Why a fit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Termination {
    /// Converged: the last step lowered the cost by less than the relevant share.
    SmallDecrease,
    /// Converged: no step lowers the cost, and its quadratic model predicts no decrease by a relevant share.
    SmallPredictedDecrease,
    /// Not converged: no step lowers the cost, although its quadratic model predicts a decrease.
    NoDescent,
    /// Not converged: the normal equations are not positive definite or not finite, however much they are damped.
    Singular,
    /// Not converged: the cost was still falling after the largest number of steps.
    StepLimit,
    /// Not converged: the cost was not falling far enough for the fit to be of use.
    GivenUp,
    /// No value was free except the windows' own, or none at all: the model was evaluated as given.
    AsGiven,
}

impl Termination {
    /// Whether the values may be taken as the minimum of the cost.
    pub fn has_converged(self) -> bool {
        match self {
            Self::SmallDecrease | Self::SmallPredictedDecrease | Self::AsGiven => true,
            Self::NoDescent | Self::Singular | Self::StepLimit | Self::GivenUp => false,
        }
    }
}

impl fmt::Display for Termination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SmallDecrease => "converged: the last step barely lowered the loss",
            Self::SmallPredictedDecrease => "converged: no step lowers the loss any further",
            Self::NoDescent => {
                "not converged: no step lowers the loss, although its derivatives predict a decrease"
            }
            Self::Singular => "not converged: the normal equations cannot be solved",
            Self::StepLimit => "not converged: the loss was still falling at the last step allowed",
            Self::GivenUp => "not converged: stopped early, the loss was not falling far enough",
            Self::AsGiven => "evaluated as given",
        })
    }
}
