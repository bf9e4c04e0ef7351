use std::f64::consts::TAU;
use std::path::PathBuf;

use crate::data::Log;
use crate::identify::Window;
use crate::model::{Commands, Dynamics, Rollout, Sensors, StepTorque};

/// A motion of a rig before it is simulated.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Motion {
    /// Angles, then velocities.
    pub start: Vec<f64>,
    /// Time of each row in s.
    pub time: Vec<f64>,
    /// `[row][joint]`, each held until the next row.
    pub tau: Vec<Vec<f64>>,
}

/// Steps of the simulation are no longer than this (s), as in fits.
const LONGEST_STEP_S: f64 = 2e-3;

impl Motion {
    /// The log of a model's motion, with true velocities; `None` where it diverges.
    pub fn simulate(&self, dynamics: &Dynamics, values: &[f64]) -> Option<Log> {
        let n = dynamics.joints;
        let mut rollout = Rollout::<f64, 1>::new(dynamics, values);
        let mut state: Vec<[f64; 1]> = self.start.iter().map(|value| [*value]).collect();
        let mut log = Log {
            path: PathBuf::new(),
            time: self.time.clone(),
            q: vec![Vec::new(); n],
            qd: vec![Vec::new(); n],
            tau: (0..n)
                .map(|j| self.tau.iter().map(|tau| tau[j]).collect())
                .collect(),
            leave_out: Vec::new(),
            notes: Vec::new(),
        };
        let tau = log.tau.clone();
        let commands = Commands::new(dynamics, values, &self.time, &tau);
        let mut sensors = Sensors::<1>::new(dynamics, values);
        for (row, tau) in self.tau.iter().enumerate() {
            if state.iter().any(|value| !value[0].is_finite()) {
                return None;
            }
            let before = || Commands::just_before([&commands], [row]);
            let shown = sensors.show(&state, before, [self.time[row]]);
            for j in 0..n {
                log.q[j].push(shown[j][0]);
                log.qd[j].push(state[n + j][0]);
            }
            let Some(next) = self.time.get(row + 1) else {
                break;
            };
            let now = self.time[row];
            let dt = next - now;
            let held: Vec<[f64; 1]> = tau.iter().map(|tau| [*tau]).collect();
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // a small positive number
            let substeps = ((dt / LONGEST_STEP_S - 1e-6).ceil() as usize).max(1);
            let torque = StepTorque::new([&commands], &held, [now], [*next], substeps);
            rollout.advance(&mut state, &torque.mean, [now], [dt], substeps);
        }
        Some(log)
    }
}

/// Whether a joint goes round.
pub(super) fn is_turn(q: &[f64]) -> bool {
    let low = q.iter().copied().fold(f64::INFINITY, f64::min);
    let high = q.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    high - low > TAU
}

/// Consecutive windows of `length_s` in simulated logs: their states are known at every row.
pub(super) fn windows(logs: &[Log], length_s: f64) -> Vec<Window> {
    let mut windows = Vec::new();
    for (index, log) in logs.iter().enumerate() {
        let slack = 0.5 * log.median_step();
        let mut first = 0;
        while first + 1 < log.rows() {
            let end = log.time[first] + length_s;
            let last = log.time.partition_point(|t| *t <= end + slack) - 1;
            if last == first || log.time[last] < end - slack {
                break;
            }
            windows.push(Window {
                log: index,
                first,
                last,
            });
            first = last;
        }
    }
    windows
}

/// The state of a simulated log at a window's start.
pub(super) fn start_of(logs: &[Log], window: &Window) -> Vec<f64> {
    let log = &logs[window.log];
    let columns = log.q.iter().chain(&log.qd);
    columns.map(|column| column[window.first]).collect()
}
