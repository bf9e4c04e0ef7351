use residyn_core::data::Log;
use residyn_train::{Segments, SegmentsError};

/// The transitions of recorded motion for training, with the states as measured.
///
/// # Errors
/// Logs with different numbers of joints.
pub fn transitions(logs: &[Log], joints: usize) -> Result<Segments, SegmentsError> {
    let mut segments = Segments::new(joints, 1);
    for log in logs {
        let (states, inputs) = (by_row(log.q.iter().chain(&log.qd)), by_row(log.tau.iter()));
        segments.push_trajectory(&log.time, &states, &inputs, 1)?;
    }
    Ok(segments)
}

/// The columns, row by row.
fn by_row<'l>(columns: impl Iterator<Item = &'l Vec<f64>> + Clone) -> Vec<f64> {
    let rows = columns.clone().next().map_or(0, Vec::len);
    let row = |k: usize| columns.clone().map(move |column| column[k]);
    (0..rows).flat_map(row).collect()
}
