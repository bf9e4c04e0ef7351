use crate::data::Log;
use crate::train::{Segments, SegmentsError};

/// What is known of a plant: stretches of its motion, each one log.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Experience {
    pub logs: Vec<Log>,
}

impl Experience {
    /// The transitions for training, states as they were measured.
    ///
    /// # Errors
    /// Logs that do not belong together.
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

/// Columns one row after the other.
fn by_row(columns: &[&Vec<f64>]) -> Vec<f64> {
    let row = |k: usize| columns.iter().map(move |column| column[k]);
    (0..columns[0].len()).flat_map(row).collect()
}
