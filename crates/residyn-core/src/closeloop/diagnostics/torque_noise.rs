//! How the sensors' noise changes the torques that a logged motion needs.

use nalgebra::DVector;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::closeloop::problem::Problem;
use crate::data::{Channel, JointAudit, Log};
use crate::identify::Values;
use crate::model::Model;

/// The torque residuals of a model in some windows of a problem, and what noise adds to them.
pub(super) struct TorqueNoise<'a> {
    problem: &'a Problem<'a>,
    model: &'a Model,
    windows: &'a [usize],
    residuals: Vec<DVector<f64>>,
}

impl<'a> TorqueNoise<'a> {
    pub fn new(problem: &'a Problem<'a>, model: &'a Model, windows: &'a [usize]) -> Self {
        Self {
            residuals: residuals(problem, model, windows, problem.logs),
            problem,
            model,
            windows,
        }
    }

    /// The residuals of each window, in N m (or N), `[row * joints + joint]`.
    pub fn residuals(&self) -> &[DVector<f64>] {
        &self.residuals
    }

    /// The change of the residuals with a draw of all sensors' noise.
    pub fn draw(&self, rng: &mut impl Rng) -> Vec<DVector<f64>> {
        let audits = self.problem.audits().iter();
        let order = self.problem.joints_by_motion();
        let logs: Vec<Log> = (self.problem.logs.iter().zip(audits))
            .map(|(log, audit)| noisier(log, &audit.joints, &order, rng))
            .collect();
        let noisy = residuals(self.problem, self.model, self.windows, &logs);
        let both = noisy.into_iter().zip(&self.residuals);
        both.map(|(noisy, residuals)| noisy - residuals).collect()
    }
}

fn residuals(
    problem: &Problem<'_>,
    model: &Model,
    windows: &[usize],
    logs: &[Log],
) -> Vec<DVector<f64>> {
    let chosen = windows.iter().map(|&w| problem.shooting.windows[w]);
    let (noise, widths) = (&problem.shooting.noise, &problem.smoothing_velocities);
    let shooting = (problem.error_model).shooting(logs, chosen.collect(), noise, widths);
    let dynamics = problem.compiled(model);
    let values = Values::of(&dynamics, logs);
    let all = shooting.residuals(&dynamics, &values, &shooting.initial_start_states(0));
    let in_units = |residuals: Vec<f64>| {
        let values = residuals.iter().zip(noise.iter().cycle());
        DVector::from_iterator(residuals.len(), values.map(|(r, unit)| r * unit))
    };
    all.into_iter().map(in_units).collect()
}

/// A log with added noise on positions and torques, as large as they seem to carry, drawn for the joints in this order.
fn noisier(log: &Log, joints: &[JointAudit], order: &[usize], rng: &mut impl Rng) -> Log {
    let mut noisier = log.clone();
    let mut add = |values: &mut [f64], channel: &Channel| {
        let noise = channel.noise_std.max(channel.resolution / 12.0_f64.sqrt());
        for value in values {
            let drawn: f64 = StandardNormal.sample(rng);
            *value += noise * drawn;
        }
    };
    for &j in order {
        add(&mut noisier.q[j], &joints[j].q);
        add(&mut noisier.tau[j], &joints[j].tau);
    }
    noisier
}
