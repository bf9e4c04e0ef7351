use nalgebra::{DMatrix, DVector};

use crate::expr::Program;

/// The torques that accelerate the joints of a model as wanted, for models that give accelerations as well: torques add to them
/// in proportion.
#[derive(Debug, Clone)]
pub struct InverseDynamics {
    /// Accelerations, and how much each changes for each N m of every torque.
    program: Program,
    /// Of the program, with angles and speeds first; without torques.
    inputs: Vec<f64>,
    joints: usize,
}

impl InverseDynamics {
    pub(super) fn new(program: Program, inputs: Vec<f64>, joints: usize) -> Self {
        Self {
            program,
            inputs,
            joints,
        }
    }

    /// At angles `q` (rad or m) and speeds `qd` (per s): the accelerations without torques, and those of each joint (row) for
    /// 1 N m (or N) at each joint (column).
    pub fn forward(&self, q: &[f64], qd: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let mut inputs = self.inputs.clone();
        inputs[..q.len()].copy_from_slice(q);
        inputs[q.len()..][..qd.len()].copy_from_slice(qd);
        let outputs = self.program.eval(&inputs);
        let (free, slopes) = outputs.split_at(self.joints);
        let slopes = DMatrix::from_row_slice(self.joints, self.joints, slopes);
        (DVector::from_column_slice(free), slopes)
    }

    /// The torques that give accelerations `qdd` (per s^2) there, N m (or N); `None` where some joint follows no torque.
    pub fn torques(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Option<Vec<f64>> {
        let (free, slopes) = self.forward(q, qd);
        let torques = slopes
            .lu()
            .solve(&(DVector::from_column_slice(qdd) - free))?;
        let is_finite = torques.iter().all(|torque| torque.is_finite());
        is_finite.then(|| torques.as_slice().to_vec())
    }
}
