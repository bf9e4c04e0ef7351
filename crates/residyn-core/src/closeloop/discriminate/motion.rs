use std::f64::consts::TAU;

use crate::data::Log;
use crate::data::statistics::ends;
use crate::identify::Window;
use crate::model::Dynamics;
use crate::sim::{Commands, FIT_S, RK4, Simulator};

/// A motion of a rig before it is simulated.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Motion {
    /// Number of the problem's log that it begins in.
    pub log: usize,
    /// Angles, then velocities.
    pub start: Vec<f64>,
    /// Time of each row in s.
    pub time: Vec<f64>,
    /// Torques, `[row][joint]`, each held until the next row.
    pub tau: Vec<Vec<f64>>,
    /// What the further measured columns of its log read, `[row][column]`, each held until the next row.
    pub measured: Vec<Vec<f64>>,
}

/// Simulated logs, each a sequence of motions.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Record {
    pub logs: Vec<Log>,
    /// For each log, the problem's log that its motions begin in, from which per-log values are taken.
    pub origins: Vec<usize>,
    /// The rows of each motion.
    pub motions: Vec<Window>,
    /// The motions in consecutive parts.
    pub windows: Vec<Window>,
}

impl Record {
    /// Simulated motions that begin in these `logs`, cut into windows of `length_s`; the rig stands for `pause_s`
    /// between two motions of one log. Per-log values are those of `logs`. `None` if the model diverges.
    pub fn of(
        motions: &[Motion],
        logs: &[Log],
        dynamics: &Dynamics,
        (length_s, pause_s): (f64, f64),
    ) -> Option<Self> {
        let mut record = Self::default();
        for motion in motions {
            let index = record.log_of(motion.log, &logs[motion.log]);
            let first = append(&mut record.logs[index], motion, pause_s);
            let model = dynamics.in_log(&logs[motion.log]);
            simulate(&mut record.logs[index], first, &motion.start, &model)?;
            let log = &record.logs[index];
            record.motions.push(Window {
                log: index,
                first,
                last: log.rows() - 1,
            });
            record.windows.extend(windows(log, index, first, length_s));
        }
        Some(record)
    }

    /// Number of the record's log for motions that begin in a log of the problem; it has that log's name.
    fn log_of(&mut self, origin: usize, log: &Log) -> usize {
        if let Some(known) = self.origins.iter().position(|known| *known == origin) {
            return known;
        }
        self.origins.push(origin);
        self.logs.push(Log {
            path: log.path.clone(),
            driven_by: log.driven_by,
            measured: log.empty_measured(),
            ..Log::empty(log.joints())
        });
        self.logs.len() - 1
    }

    /// This record followed by another, with separate logs.
    pub fn and(&self, other: &Self) -> Self {
        let joined = |own: &[Window], others: &[Window]| {
            let moved = others.iter().map(|window| Window {
                log: window.log + self.logs.len(),
                ..*window
            });
            own.iter().copied().chain(moved).collect()
        };
        Self {
            motions: joined(&self.motions, &other.motions),
            windows: joined(&self.windows, &other.windows),
            logs: [self.logs.as_slice(), &other.logs].concat(),
            origins: [self.origins.as_slice(), &other.origins].concat(),
        }
    }

    /// The true states at the starts of windows.
    pub fn starts(&self, windows: std::ops::RangeFrom<usize>) -> Vec<Vec<f64>> {
        let start = |window: &Window| {
            let log = &self.logs[window.log];
            let columns = log.q.iter().chain(&log.qd);
            columns.map(|column| column[window.first]).collect()
        };
        self.windows[windows].iter().map(start).collect()
    }

    /// Total length in s of these windows.
    pub fn duration_s(&self, windows: std::ops::RangeFrom<usize>) -> f64 {
        let windows = self.windows[windows].iter();
        windows.map(|w| w.duration_s(&self.logs)).sum()
    }
}

/// Append the torques and measured columns of a motion to a log, after a pause, and return the row at which it begins.
fn append(log: &mut Log, motion: &Motion, pause_s: f64) -> usize {
    let after_pause = |last: &f64| last + 2.0 * pause_s;
    let earliest = log.time.last().map_or(f64::NEG_INFINITY, after_pause);
    let delay = (earliest - motion.time[0]).max(0.0);
    let pause = (motion.time[0] - pause_s, 0);
    let rows = motion.time.iter().copied().zip(0..);
    for (time, row) in std::iter::once(pause).chain(rows) {
        log.time.push(time + delay);
        for (column, tau) in log.tau.iter_mut().zip(&motion.tau[row]) {
            column.push(*tau);
        }
        for (column, value) in log.measured.iter_mut().zip(&motion.measured[row]) {
            column.values.push(*value);
        }
    }
    log.time.len() - motion.time.len()
}

/// Fill in the states of a model from row `first` to the end of a log; `None` if it diverges.
fn simulate(log: &mut Log, first: usize, start: &[f64], model: &Dynamics) -> Option<()> {
    let commanded = log.clone();
    let commands = [&Commands::of_log(model, &commanded)];
    let mut simulator = Simulator::new(model, RK4);
    simulator.place(start);
    // The row of the pause, which nothing reads, has the start state.
    let columns = log.q.iter_mut().chain(&mut log.qd);
    for (column, value) in columns.zip(start) {
        column.resize(first, *value);
    }
    for row in first..log.rows() {
        if row > first {
            simulator.follow(commands, [row - 1], FIT_S);
        }
        if simulator.state.iter().any(|value| !value[0].is_finite()) {
            return None;
        }
        let shown = simulator.shown(commands, [row]).concat();
        let columns = log.q.iter_mut().chain(&mut log.qd);
        for (column, value) in columns.zip(shown) {
            column.push(value[0]);
        }
    }
    Some(())
}

/// Whether a joint makes more than a full turn.
pub(super) fn is_turn(q: &[f64]) -> bool {
    let [low, high] = ends(q);
    high - low > TAU
}

/// Consecutive windows of `length_s` from row `first` on.
fn windows(log: &Log, index: usize, first: usize, length_s: f64) -> Vec<Window> {
    let step_s = log.median_step();
    let mut windows = Vec::new();
    let mut first = first;
    while first + 1 < log.rows() {
        let end = log.time[first] + length_s;
        let last = log.time.partition_point(|t| *t <= end + 0.5 * step_s) - 1;
        if last == first || log.time[last] < end - 0.5 * step_s {
            break;
        }
        windows.push(Window {
            log: index,
            first,
            last,
        });
        first = last;
    }
    windows
}
