use super::curve::{Curve, curves};
use super::force::{ForceSample, residual_force};
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::data::statistics::upper_median;
use crate::identify::FitError;

/// The residual generalised force of a model along the training logs.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualForce {
    pub samples: Vec<ForceSample>,
    /// The samples as smooth curves over each variable.
    pub curves: Vec<Curve>,
}

impl ResidualForce {
    /// # Errors
    /// If the logs have no block, or the model diverges over a block.
    pub(in crate::closeloop) fn of(
        problem: &Problem<'_>,
        fitted: &Fitted,
    ) -> Result<Self, FitError> {
        let samples = residual_force(problem, fitted)?;
        let prismatic = &problem.declared.prismatic;
        let curves = curves(&samples, prismatic, &problem.settings.curves);
        Ok(Self { samples, curves })
    }

    /// Root mean square over blocks and joints, with outliers limited to three times the median, in N m (or N).
    pub fn norm(&self) -> f64 {
        let forces = self.samples.iter().flat_map(|sample| &sample.force);
        let squares: Vec<f64> = forces.map(|force| force * force).collect();
        let limit = 9.0 * upper_median(&squares);
        let sum: f64 = squares.iter().map(|square| square.min(limit)).sum();
        (sum / squares.len() as f64).sqrt()
    }
}
