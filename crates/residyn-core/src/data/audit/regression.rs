//! A joint's acceleration and torque as linear regressions on its motion.

use super::motion::Motion;
use crate::data::Joint;
use crate::data::projection::{free_of, orthonormal};

/// A regression with fewer rows than this per column says nothing.
const ROWS_A_COLUMN: usize = 10;

/// What a joint's acceleration and torque are regressed on.
pub(super) struct Regression<'m> {
    pub motion: &'m Motion,
    /// Orthonormal columns for the [`regressors`], the constant first.
    pub basis: Vec<Vec<f64>>,
    /// What they leave of the acceleration, scaled to unit length.
    pub acceleration: Option<Vec<f64>>,
}

impl<'m> Regression<'m> {
    /// `None` if the log is too short; `fast_rad_s` holds the fast speed of every joint.
    pub fn of(motions: &'m [Motion], fast_rad_s: &[f64], joint: Joint) -> Option<Self> {
        let motion = &motions[joint];
        let columns = regressors(motions, fast_rad_s, joint);
        if motion.rows() < ROWS_A_COLUMN * (columns.len() + 1) {
            return None;
        }
        let basis = orthonormal(columns);
        let acceleration = free_of(&basis, &motion.acceleration);
        Some(Self {
            motion,
            basis,
            acceleration,
        })
    }
}

/// Gravity, friction and coupling of a joint: a constant, the sine and cosine of all angles, all velocities and their
/// smoothed signs, and the accelerations of the other joints; one column each, one value per row of the motions.
///
/// `fast_rad_s` holds the fast speed of every joint.
pub(super) fn regressors(motions: &[Motion], fast_rad_s: &[f64], joint: Joint) -> Vec<Vec<f64>> {
    let mut columns = vec![vec![1.0; motions[joint].rows()]];
    for (other, motion) in Joint::all(motions.len()).zip(motions) {
        let of = |values: &[f64], f: &dyn Fn(f64) -> f64| values.iter().map(|x| f(*x)).collect();
        // Smooth over a tenth of the working speed, as a jump would follow the noise at rest.
        let width = 0.1 * fast_rad_s[other] + f64::MIN_POSITIVE;
        columns.push(of(&motion.velocity, &|v| (v / width).tanh()));
        columns.push(of(&motion.q, &f64::sin));
        columns.push(of(&motion.q, &f64::cos));
        columns.push(motion.velocity.clone());
        if other != joint {
            columns.push(motion.acceleration.clone());
        }
    }
    columns
}
