//! Trajectories as training reads them: full states, row by row.

use super::{Log, SAME_S, half_width_s, local_cubic};

/// States and torques of one motion, row by row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory {
    /// Time of each row \[s\].
    pub time: Vec<f64>,
    /// `[row][state]`: positions, velocities, then the internal states of a model.
    pub states: Vec<f64>,
    /// `[row][n]`: the torque until the next row.
    pub inputs: Vec<f64>,
}

/// How a log becomes trajectories.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thinning {
    /// Rows closer than this \[s\] are merged, with their mean torque: a network should learn a force, not the
    /// encoder's noise.
    pub step_s: f64,
    /// A trajectory of this length \[s\] ends and a new one begins; infinite to cut only where data are
    /// missing.
    pub length_s: f64,
}

/// The log's motions with smoothed states, cut at gaps and at intervals that are left out, and with a model's `internal`
/// states along it, `[state][row]`. Some may be empty or have a single row.
pub fn trajectories(log: &Log, internal: &[Vec<f64>], thinning: Thinning) -> Vec<Trajectory> {
    let step = log.median_step();
    let half_width = half_width_s(step);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small positive number
    let merged = ((thinning.step_s / step).round() as usize).max(1);
    let mut all = vec![Trajectory::default()];
    for first in (0..log.rows().saturating_sub(merged)).step_by(merged) {
        let (from, to) = (log.time[first], log.time[first + merged]);
        let broken = to - from > 2.0 * step * merged as f64 + SAME_S
            || log.leave_out.iter().any(|span| span.touches(from, to));
        let states: Option<Vec<_>> = log
            .q
            .iter()
            .map(|q| local_cubic(&log.time, q, first, half_width))
            .collect();
        let current = all.last_mut().expect("there is always one");
        let full = current
            .time
            .first()
            .is_some_and(|start| from - start >= thinning.length_s - SAME_S);
        match states {
            Some(states) if !broken => {
                current.time.push(from);
                current.states.extend(states.iter().map(|s| s.value));
                current.states.extend(states.iter().map(|s| s.slope));
                current.states.extend(internal.iter().map(|z| z[first]));
                #[allow(clippy::cast_precision_loss)] // few rows
                let mean =
                    |tau: &Vec<f64>| tau[first..first + merged].iter().sum::<f64>() / merged as f64;
                current.inputs.extend(log.tau.iter().map(mean));
                if full {
                    all.push(Trajectory::default());
                }
            }
            _ => all.push(Trajectory::default()),
        }
    }
    all
}
