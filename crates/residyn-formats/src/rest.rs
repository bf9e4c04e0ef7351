//! How short a model's steps must be near rest, where dry friction is steepest.

use std::f64::consts::PI;

use nalgebra::DMatrix;
use nalgebra::linalg::Schur;
use rand::{Rng, RngExt};

use super::ExportModel;
use residyn_core::model::{Dynamics, NetworkError};

/// Largest product of decay rate and step length at which a step decays without overshooting, whatever the scheme.
const WITHOUT_OVERSHOOT: f64 = 1.0;
/// Velocity on either side of rest for the slope of friction \[rad/s or m/s\]: friction reverses over a far wider
/// range.
const AROUND_REST: f64 = 1e-7;
/// Number of positions examined.
const POSITIONS: usize = 64;
/// Precision of the eigenvalues, and the most iterations.
const PRECISION: f64 = 1e-9;
const ITERATIONS: usize = 1000;

impl ExportModel {
    /// The number of equal parts in which a step must be integrated so that friction brings the model to rest: in
    /// longer parts, velocities overshoot, and a model that should rest creeps or chatters. It follows from the fastest
    /// decay rate of velocities at rest, at positions drawn from `rng`.
    ///
    /// # Errors
    /// A network that does not fit the number of joints.
    pub fn substeps_around_rest(&self, rng: &mut impl Rng) -> Result<usize, NetworkError> {
        let whole = self.reference()?.whole;
        let mut position = || -> Vec<f64> {
            let each = 0..whole.joints;
            each.map(|_| rng.random_range(-PI..PI)).collect()
        };
        let rates = (0..POSITIONS).map(|_| rate(&whole, &position()));
        let fastest = rates.fold(0.0, f64::max);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let parts = (fastest * self.step_s / WITHOUT_OVERSHOOT).ceil() as usize;
        Ok(parts.max(1))
    }
}

/// The fastest decay rate of velocities \[1/s\] at rest in a position, without torque.
fn rate(model: &Dynamics, position: &[f64]) -> f64 {
    let (n, values) = (model.joints, model.values());
    let still = vec![0.0; n];
    let internal = model.internal_starts(&values);
    let accelerations = |joint: usize, velocity: f64| {
        let mut state = [position, &still, &internal].concat();
        state[n + joint] = velocity;
        model.rates(&state, &still, &values)[n..2 * n].to_vec()
    };
    let mut slopes = DMatrix::zeros(n, n);
    for joint in 0..n {
        let [faster, slower] = [AROUND_REST, -AROUND_REST].map(|v| accelerations(joint, v));
        for (i, (faster, slower)) in faster.iter().zip(slower).enumerate() {
            slopes[(i, joint)] = (faster - slower) / (2.0 * AROUND_REST);
        }
    }
    let schur = Schur::try_new(slopes, PRECISION, ITERATIONS);
    schur.map_or(0.0, |schur| {
        let rates = schur.complex_eigenvalues();
        rates.iter().map(|rate| -rate.re).fold(0.0, f64::max)
    })
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use residyn_core::model::{Library, Model};
    use residyn_core::sim::Integrator;

    /// A pendulum of 3 (rad/s^2)/(N m).
    fn pendulum(effect: &str) -> ExportModel {
        let text = Library::system_text("pendulum").unwrap();
        let library = Library::built_in();
        let model = Model::from_text(
            "p.toml".as_ref(),
            &(text.to_owned() + effect),
            library.effects(),
        )
        .unwrap();
        ExportModel::of_system(&model, Integrator::RK4, 0.01, Value::Null)
    }

    #[test]
    fn friction_asks_for_the_steps_of_its_slope() {
        let friction = "\n[[effect]]\nname = \"coulomb_friction\"\njoint = 1\nF_c = 0.19\n";
        let substeps = |model: ExportModel| {
            model
                .substeps_around_rest(&mut residyn_core::rng(1))
                .unwrap()
        };
        assert_eq!(substeps(pendulum("")), 1);
        // Friction reverses over 0.01 rad/s: 3 * 0.19 / 0.01 = 57/s, times a step of 10 ms is 0.57.
        assert_eq!(substeps(pendulum(friction)), 1);
        let mut narrow = pendulum(friction);
        narrow.step_s = 0.1;
        assert_eq!(substeps(narrow), 6);
    }
}
