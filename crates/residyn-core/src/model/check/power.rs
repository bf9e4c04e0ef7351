//! Coriolis and centrifugal forces that are not consistent with the mass matrix. Consistent ones neither add nor remove
//! energy, qd' (dM/dt / 2) qd = qd' c: only gravity, friction and motors change the kinetic energy.

use nalgebra::{DMatrix, DVector};
use rand::Rng;

use super::mass::{at, at_rest, drawn};
use super::{Finding, Kind};
use crate::model::system::{Model, Motion};

/// How long joints move along their velocities to find the slope of the mass matrix \[s\].
const STEP_S: f64 = 1e-5;
/// A difference below this share of either power comes from numerical slopes, or from rounded numbers in the file.
const SAME: f64 = 1e-3;
/// Below this share of the kinetic energy, per second, both powers count as zero.
const NOTHING: f64 = 1e-6;

/// The two powers in a state \[W\].
struct Powers {
    state: Vec<f64>,
    energy: f64,
    of_mass: f64,
    of_bias: f64,
}

impl Powers {
    /// The difference as a share of the larger; 0 if both count as zero.
    fn apart(&self) -> f64 {
        let largest = self.of_mass.abs().max(self.of_bias.abs());
        match largest > NOTHING * self.energy {
            true => (self.of_mass - self.of_bias).abs() / largest,
            false => 0.0,
        }
    }
}

pub(super) fn find(model: &Model, rng: &mut impl Rng) -> Vec<Finding> {
    let Motion::MassAndBias { bias, .. } = &model.equations.motion else {
        return Vec::new();
    };
    let powers = powers(&model.with_effects(Vec::new()), rng);
    let differ = powers.into_iter().filter(|powers| powers.apart() > SAME);
    let worst = differ.max_by(|a, b| a.apart().total_cmp(&b.apart()));
    let finding = |worst: Powers| {
        let text = format!(
            "the velocity-product terms of `bias` take {:.4} W, but the mass matrix implies {:.4}: check their signs \
             and factors; at {}",
            worst.of_bias,
            worst.of_mass,
            at(model, &worst.state)
        );
        Finding::new(Kind::Power, model.line(bias[0].at), text)
    };
    worst.map(finding).into_iter().collect()
}

fn powers(model: &Model, rng: &mut impl Rng) -> Vec<Powers> {
    let Some(program) = model.mass_and_bias_program() else {
        return Vec::new();
    };
    let n = model.joints;
    let values = model.values();
    let mass_and_bias = |q: &[f64], qd: &[f64]| {
        let mut mass = program.eval(&[q, qd, &at_rest(model), &values].concat());
        let bias = mass.split_off(n * n);
        (DMatrix::from_row_slice(n, n, &mass), DVector::from(bias))
    };
    let of_state = |state: Vec<f64>| {
        let (q, qd) = state.split_at(n);
        let moved = |by: f64| -> Vec<f64> { q.iter().zip(qd).map(|(q, qd)| q + by * qd).collect() };
        let mass_at = |by: f64| mass_and_bias(&moved(by), qd).0;
        let slope = (mass_at(STEP_S) - mass_at(-STEP_S)) / (2.0 * STEP_S);
        let back: Vec<f64> = qd.iter().map(|qd| -qd).collect();
        // Friction changes sign with the velocity; gravity acts at rest, too.
        let bias_at = |qd: &[f64]| mass_and_bias(q, qd).1;
        let even = 0.5 * (bias_at(qd) + bias_at(&back)) - bias_at(&vec![0.0; n]);
        let (mass, qd) = (mass_at(0.0), DVector::from_column_slice(qd));
        Powers {
            energy: 0.5 * qd.dot(&(mass * &qd)),
            of_mass: 0.5 * qd.dot(&(slope * &qd)),
            of_bias: qd.dot(&even),
            state,
        }
    };
    drawn(n, rng).into_iter().map(of_state).collect()
}
