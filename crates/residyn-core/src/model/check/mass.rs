//! A mass matrix that rigid bodies cannot have: not symmetric, singular, or with negative inertia in some direction.

use nalgebra::DMatrix;
use rand::{Rng, RngExt};

use super::{Finding, Kind};
use crate::data::{Joint, NOMINAL};
use crate::decomposition::eigen;
use crate::model::system::{Model, Motion};

/// Number of states drawn.
const STATES: usize = 200;
/// Numbers closer than this share of the largest entry or eigenvalue count as equal, or as zero.
const ROUNDING: f64 = 1e-10;
/// Half a turn, rad; joints that slide move by the same number of metres.
const REACH: f64 = std::f64::consts::PI;

/// The mass matrix in a state: angles or positions, then velocities.
struct Sample {
    state: Vec<f64>,
    matrix: DMatrix<f64>,
}

pub(super) fn find(model: &Model, rng: &mut impl Rng) -> Vec<Finding> {
    let samples = samples(model, rng);
    let faults = [not_finite, not_symmetric, not_positive];
    // If entries are not finite, or the matrix is not symmetric, its eigenvalues mean nothing.
    let fault = faults.into_iter().find_map(|fault| fault(&samples));
    let line = match &model.equations.motion {
        Motion::MassAndBias { mass, .. } => Some(model.line(mass[0][0].at)),
        _ => None,
    };
    let finding = |(sample, text): (&Sample, String)| {
        let text = format!("the mass matrix {text}, at {}", at(model, &sample.state));
        Finding::new(Kind::Mass, line, text)
    };
    fault.map(finding).into_iter().collect()
}

/// None for a model that gives accelerations.
fn samples(model: &Model, rng: &mut impl Rng) -> Vec<Sample> {
    let Some(program) = model.mass_and_bias_program() else {
        return Vec::new();
    };
    let n = model.joints;
    let mut states = vec![vec![0.0; 2 * n]];
    states.extend(drawn(n, rng));
    let sample = |state: Vec<f64>| {
        let inputs = [&state, &*at_rest(model), &model.values()].concat();
        let matrix = DMatrix::from_row_slice(n, n, &program.eval(&inputs)[..n * n]);
        Sample { state, matrix }
    };
    states.into_iter().map(sample).collect()
}

/// Internal states at zero, no torque, measured columns at [`NOMINAL`], and the beginning of time: what a program reads
/// after angles and velocities.
pub(super) fn at_rest(model: &Model) -> Vec<f64> {
    let internal = vec![0.0; model.layout().internal().len()];
    let measured = vec![NOMINAL; model.measured.len()];
    [internal, vec![0.0; model.joints], measured, vec![0.0]].concat()
}

/// Random states of this many joints, anywhere.
pub(super) fn drawn(joints: usize, rng: &mut impl Rng) -> Vec<Vec<f64>> {
    let mut state = || {
        let values = (0..2 * joints).map(|_| rng.random_range(-REACH..REACH));
        values.collect()
    };
    (0..STATES).map(|_| state()).collect()
}

fn not_finite(samples: &[Sample]) -> Option<(&Sample, String)> {
    let is_finite = |sample: &Sample| sample.matrix.iter().all(|entry| entry.is_finite());
    let sample = samples.iter().find(|sample| !is_finite(sample))?;
    Some((sample, "has an entry that is not a number".to_owned()))
}

fn not_symmetric(samples: &[Sample]) -> Option<(&Sample, String)> {
    let difference = |sample: &Sample| (&sample.matrix - sample.matrix.transpose()).amax();
    let share = |sample: &Sample| difference(sample) / sample.matrix.amax();
    let worst = samples
        .iter()
        .max_by(|a, b| share(a).total_cmp(&share(b)))?;
    if !(share(worst) > ROUNDING) {
        return None;
    }
    let apart = (&worst.matrix - worst.matrix.transpose()).map(f64::abs);
    let (row, column) = apart.iamax_full();
    let message = format!(
        "is not symmetric: {:.4} in row {}, column {}, and {:.4} across the diagonal; only the lower one is used",
        worst.matrix[(row, column)],
        row + 1,
        column + 1,
        worst.matrix[(column, row)]
    );
    Some((worst, message))
}

fn not_positive(samples: &[Sample]) -> Option<(&Sample, String)> {
    let ends = |sample: &Sample| {
        let eigen = eigen(sample.matrix.clone());
        eigen.map_or([f64::NAN; 2], |eigen| {
            [eigen.eigenvalues.min(), eigen.eigenvalues.amax()]
        })
    };
    let ends = samples.iter().map(|sample| (sample, ends(sample)));
    let share = |[least, most]: [f64; 2]| if most > 0.0 { least / most } else { 0.0 };
    let (sample, [least, most]) = ends.min_by(|a, b| share(a.1).total_cmp(&share(b.1)))?;
    let share = share([least, most]);
    if share > ROUNDING {
        return None;
    }
    let what = match share < -ROUNDING {
        true => "is not positive definite",
        false => "is singular",
    };
    let message = format!("{what}: its smallest eigenvalue is {least:.3e}, its largest {most:.3e}");
    Some((sample, message))
}

/// `q1 = 0, q2 = 1.571`; velocities matter only if formulas depend on them.
pub(super) fn at(model: &Model, state: &[f64]) -> String {
    let angles = Joint::all(model.joints).zip(state);
    let angles = angles.map(|(joint, q)| format!("{} = {q:.4}", joint.name("q")));
    angles.collect::<Vec<_>>().join(", ")
}
