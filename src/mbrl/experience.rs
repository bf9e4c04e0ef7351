use crate::data::Log;
use crate::train::{Segments, SegmentsError};

/// The recorded motion of a plant: stretches, one log each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Experience {
    pub logs: Vec<Log>,
}

impl Experience {
    /// The transitions for training, with the states as measured.
    ///
    /// # Errors
    /// Logs with different numbers of joints.
    pub fn segments(&self, joints: usize) -> Result<Segments, SegmentsError> {
        let mut segments = Segments::new(joints, 1);
        for log in &self.logs {
            let states: Vec<&Vec<f64>> = log.q.iter().chain(&log.qd).collect();
            let (states, inputs) = (by_row(&states), by_row(&log.tau.iter().collect::<Vec<_>>()));
            segments.push_trajectory(&log.time, &states, &inputs, 1)?;
        }
        Ok(segments)
    }
}

/// The columns, row by row.
fn by_row(columns: &[&Vec<f64>]) -> Vec<f64> {
    let row = |k: usize| columns.iter().map(move |column| column[k]);
    (0..columns[0].len()).flat_map(row).collect()
}
