//! Rows as they come, at even steps and smoothed: constant memory, whatever the length.

use super::kernel::{Delayed, Kernel};
use residyn_core::data::TorqueColumn;

/// A step longer than this many median ones is a gap: the rows before and after it are not smoothed together.
const GAP_STEPS: f64 = 1.7;
/// This many neighbouring rows that repeat all angles are a rest, not a reading that came late.
const RESTING_ROWS: usize = 5;
/// An angle whose second difference is this many times the largest one of the healthy stretch has jumped: no motion makes
/// that.
const JUMP: f64 = 3.0;
/// Two times that differ by less than this share of a step are one.
const SAME_STEP: f64 = 1e-6;

/// One row of the machine.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    pub time: f64,
    pub q: Vec<f64>,
    pub driven: Vec<f64>,
    pub measured: Vec<f64>,
}

/// Motion and torques at one moment, smoothed alike.
#[derive(Debug, Clone)]
pub(crate) struct Sample {
    pub time: f64,
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    pub qdd: Vec<f64>,
    pub driven: Vec<f64>,
    pub measured: Vec<f64>,
    /// The signs of the velocities.
    pub directions: Vec<f64>,
    /// Whether it is the first one after a gap.
    pub is_first: bool,
}

/// What was not used as it came.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Irregular {
    pub gaps: usize,
    pub jumps: usize,
    pub repeated: usize,
}

pub(crate) struct Grid {
    kernel: Kernel,
    /// One for each joint's torque or command.
    delayed: Vec<Delayed>,
    torque: TorqueColumn,
    step_s: f64,
    /// Rows of the grid from one sample to the next.
    stride: usize,
    /// Speeds over which directions reverse.
    widths: Vec<f64>,
    /// Rows since the last one with fresh angles, which is the first.
    since: Vec<Row>,
    /// Even rows that are still needed.
    even: Vec<Row>,
    next_time: f64,
    /// Even rows until the next sample.
    until_sample: usize,
    is_first: bool,
    /// Largest second difference of each angle in the healthy stretch.
    bends: Vec<f64>,
    last: Vec<Vec<f64>>,
    pub is_healthy: bool,
    pub irregular: Irregular,
}

impl Grid {
    pub fn new(
        kernel: Kernel,
        delayed: Vec<Delayed>,
        torque: TorqueColumn,
        step_s: f64,
        widths: Vec<f64>,
    ) -> Self {
        Self {
            // More than twice within a half width: the window passes nothing that needs more.
            stride: (2 * kernel.half / 5).max(1),
            bends: vec![0.0; widths.len()],
            kernel,
            delayed,
            torque,
            step_s,
            widths,
            since: Vec::new(),
            even: Vec::new(),
            next_time: 0.0,
            until_sample: 0,
            is_first: true,
            last: Vec::new(),
            is_healthy: true,
            irregular: Irregular::default(),
        }
    }

    /// Time from one sample to the next, s.
    pub fn sample_step_s(&self) -> f64 {
        self.stride as f64 * self.step_s
    }

    /// A row, and the samples that it completes.
    pub fn push(&mut self, row: Row, samples: &mut Vec<Sample>) {
        let Some(newest) = self.since.last() else {
            return self.restart(row);
        };
        if row.time - newest.time > GAP_STEPS * self.step_s {
            self.irregular.gaps += 1;
            return self.restart(row);
        }
        if row.q == self.since[0].q && self.since.len() < RESTING_ROWS {
            self.irregular.repeated += 1;
            // The next angle is two steps away from the last.
            self.last.clear();
            return self.since.push(row);
        }
        if self.jumps(&row) {
            self.irregular.jumps += 1;
            return self.restart(row);
        }
        self.fill(&row, samples);
        self.since = vec![row];
    }

    fn restart(&mut self, row: Row) {
        self.next_time = row.time;
        self.even.clear();
        self.is_first = true;
        self.last = vec![row.q.clone()];
        self.until_sample = 0;
        self.since = vec![row];
    }

    /// Whether an angle leaves its line by more than it ever did in the healthy stretch, in which the limit is learnt.
    fn jumps(&mut self, row: &Row) -> bool {
        let last = std::mem::take(&mut self.last);
        let mut jumps = false;
        if let [before, now] = last.as_slice() {
            for (j, q) in row.q.iter().enumerate() {
                let bend = (q - 2.0 * now[j] + before[j]).abs();
                if self.is_healthy {
                    self.bends[j] = self.bends[j].max(bend);
                } else {
                    jumps |= self.bends[j] > 0.0 && bend > JUMP * self.bends[j];
                }
            }
        }
        let kept = last.into_iter().last();
        self.last = kept.into_iter().chain([row.q.clone()]).collect();
        jumps
    }

    /// The even rows up to a row with fresh angles.
    fn fill(&mut self, row: &Row, samples: &mut Vec<Sample>) {
        while self.next_time <= row.time + SAME_STEP * self.step_s {
            let time = self.next_time;
            let from = &self.since[0];
            let share = (time - from.time) / (row.time - from.time);
            let q = from.q.iter().zip(&row.q);
            let held = self.held_at(time, row);
            let even = Row {
                time,
                q: q.map(|(from, to)| from + share * (to - from)).collect(),
                driven: self.driven_at(time, row),
                measured: held.measured.clone(),
            };
            self.even.push(even);
            self.next_time += self.step_s;
            self.observe(samples);
        }
    }

    /// The row that was the newest at a time.
    fn held_at<'r>(&'r self, time: f64, new: &'r Row) -> &'r Row {
        let mut rows = self.since.iter().chain([new]).rev();
        let is_before = |row: &&Row| row.time <= time + SAME_STEP * self.step_s;
        rows.find(is_before).unwrap_or(&self.since[0])
    }

    /// The torque or command of an even row. A held one is that in the middle of the step after it.
    fn driven_at(&self, time: f64, new: &Row) -> Vec<f64> {
        if self.torque == TorqueColumn::Held {
            return self.held_at(time + 0.5 * self.step_s, new).driven.clone();
        }
        let before = self.held_at(time, new);
        let after = self
            .since
            .iter()
            .chain([new])
            .find(|row| row.time > before.time);
        let Some(after) = after else {
            return before.driven.clone();
        };
        let share = (time - before.time) / (after.time - before.time);
        let both = before.driven.iter().zip(&after.driven);
        both.map(|(from, to)| from + share * (to - from)).collect()
    }

    /// What the newest even row completes.
    fn observe(&mut self, samples: &mut Vec<Sample>) {
        let half = self.kernel.half;
        let reach = self
            .delayed
            .iter()
            .map(|own| own.past)
            .fold(half, usize::max);
        // A held torque that is a mean over the step before its row is centred one row later.
        let centre = self
            .even
            .len()
            .checked_sub(half + 2)
            .filter(|centre| *centre >= reach);
        let Some(centre) = centre else { return };
        if self.until_sample == 0 {
            samples.push(self.sample(centre));
            self.is_first = false;
            self.until_sample = self.stride;
            self.forget(centre - reach);
        }
        self.until_sample -= 1;
    }

    fn smoothed(&self, weights: &[f64], centre: usize, joint: usize) -> f64 {
        let rows = self.even[centre - self.kernel.half..].iter();
        weights
            .iter()
            .zip(rows)
            .map(|(w, row)| w * row.q[joint])
            .sum()
    }

    fn sample(&self, centre: usize) -> Sample {
        let joints = 0..self.widths.len();
        let of_angles = |weights: &[f64]| -> Vec<f64> {
            (joints.clone())
                .map(|joint| self.smoothed(weights, centre, joint))
                .collect()
        };
        let driven = self.delayed.iter().enumerate().map(|(joint, own)| {
            let rows = self.even[centre - own.past..].iter();
            own.weights
                .iter()
                .zip(rows)
                .map(|(w, row)| w * row.driven[joint])
                .sum()
        });
        let qd = of_angles(&self.kernel.slope);
        let directions = qd.iter().zip(&self.widths);
        let directions = directions.map(|(qd, width)| (qd / width.max(f64::MIN_POSITIVE)).tanh());
        Sample {
            time: self.even[centre].time,
            q: of_angles(&self.kernel.value),
            qdd: of_angles(&self.kernel.curvature),
            driven: driven.collect(),
            measured: self.even[centre].measured.clone(),
            directions: directions.collect(),
            is_first: self.is_first,
            qd,
        }
    }

    /// Drops even rows that no later sample reads.
    fn forget(&mut self, rows: usize) {
        // Seldom, so that moving the others costs nothing.
        if rows > 1024 {
            self.even.drain(..rows);
        }
    }
}
