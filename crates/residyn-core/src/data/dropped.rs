//! Rows that a logger dropped: steps of two or more periods in place of one.

use super::instant::SAME_S;
use super::jumps::interpolated;
use super::log::{Interval, Log};
use super::statistics::ends;

/// A step longer than this many median steps is a gap. Loops on desktop systems overrun by two or
/// three periods as a matter of course; beyond five the motion between the rows is anyone's guess.
const GAP_STEPS: f64 = 5.0;

/// Whether a step is too long to know how the rig moved over it, in a log with this median step \[s\].
pub(crate) fn is_gap(step_s: f64, median_step_s: f64) -> bool {
    step_s > GAP_STEPS * median_step_s + SAME_S
}

/// A step longer than this many median steps lacks a row: midway between one period and two, and beyond what jitter of a
/// fifth of a period does.
pub(super) const DROPPED_STEPS: f64 = 1.7;

/// The torque passes a missing row smoothly if its change over the step, per period, is at most this many times the
/// largest change from row to row close by.
const SMOOTH: f64 = 2.0;

/// Rows on either side that show how smoothly the torque changes.
const CLOSE_BY: usize = 4;

/// A torque change below this share of its range moves nothing that a sensor sees, whenever in the step it came.
const SMALL_CHANGE: f64 = 0.01;

/// A step in which rows are missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dropped {
    /// The last row before.
    pub row: usize,
    /// How many are missing.
    pub count: usize,
}

/// The steps in which rows are missing, gaps not counted.
pub(super) fn dropped(log: &Log) -> Vec<Dropped> {
    let step_s = log.median_step();
    let of_step = |(row, pair): (usize, &[f64])| {
        let length_s = pair[1] - pair[0];
        let steps = length_s / step_s;
        let missing = steps > DROPPED_STEPS && !is_gap(length_s, step_s);
        missing.then_some(Dropped {
            row,
            count: (steps.round() as usize).max(2) - 1,
        })
    };
    let steps = log.time.windows(2).enumerate();
    steps.filter_map(of_step).collect()
}

impl Log {
    /// The log with the rows that the logger dropped filled in, so that the torque changes as smoothly as it does
    /// around them. If it does not pass a step smoothly, the time of the change is unknown: such steps are left out,
    /// unless windows of `window_s` around them make up more than half of the log.
    pub(super) fn completed(mut self, window_s: f64) -> Log {
        let missing = dropped(&self);
        if missing.is_empty() {
            return self;
        }
        let small = |tau: &Vec<f64>| {
            let [lowest, highest] = ends(tau);
            SMALL_CHANGE * (highest - lowest)
        };
        let small: Vec<f64> = self.tau.iter().map(small).collect();
        let (smooth, rough): (Vec<Dropped>, Vec<Dropped>) =
            (missing.iter()).partition(|d| self.is_smooth_over(d, &small));
        let rough: Vec<Interval> = rough.iter().map(|d| self.step_of(d)).collect();
        if rough.len() as f64 * window_s <= 0.5 * self.duration() {
            self.leave_out.extend(rough);
        }
        self.insert(&missing, &smooth);
        self
    }

    fn step_of(&self, dropped: &Dropped) -> Interval {
        Interval {
            start_s: self.time[dropped.row],
            end_s: self.time[dropped.row + 1],
        }
    }

    /// Whether the torques of all joints change over the step as they do from row to row around it, or by no more than
    /// a `small` amount.
    fn is_smooth_over(&self, dropped: &Dropped, small: &[f64]) -> bool {
        let (row, count) = (dropped.row, dropped.count as f64 + 1.0);
        let from = row.saturating_sub(CLOSE_BY);
        let to = (row + 1 + CLOSE_BY).min(self.rows() - 1);
        self.tau.iter().zip(small).all(|(tau, small)| {
            let change = |at: usize| (tau[at + 1] - tau[at]).abs();
            let close_by = (from..to).filter(|at| *at != row).map(change);
            let largest = close_by.fold(0.0, f64::max);
            change(row) <= small.max(count * SMOOTH * largest)
        })
    }

    /// Inserts rows into steps, given in ascending order, at equal times. Angles pass all of them smoothly, torques those
    /// that are `smooth`: a straight line across three missing rows would cut three percent off a target at 4 Hz.
    fn insert(&mut self, missing: &[Dropped], smooth: &[Dropped]) {
        let time = &self.time;
        let between = |channel: &[f64], row: usize, share: f64| {
            channel[row] + share * (channel[row + 1] - channel[row])
        };
        let bent = |channel: &[f64], row: usize, share: f64| {
            let around = [row.saturating_sub(1), row, row + 1, row + 2];
            interpolated(time, channel, around, between(time, row, share))
        };
        for q in &mut self.q {
            *q = with_rows(q, missing, |row, share| bent(q, row, share));
        }
        let measured = self
            .measured
            .iter_mut()
            .map(|measured| &mut measured.values);
        for channel in self.qd.iter_mut().chain(measured) {
            *channel = with_rows(channel, missing, |row, share| between(channel, row, share));
        }
        for tau in &mut self.tau {
            let is_smooth = |row: usize| smooth.binary_search_by_key(&row, |d| d.row).is_ok();
            *tau = with_rows(tau, missing, |row, share| match is_smooth(row) {
                true => bent(tau, row, share),
                false => between(tau, row, share),
            });
        }
        self.time = with_rows(time, missing, |row, share| between(time, row, share));
        // Number of rows inserted before each step, and before the end.
        let mut before = vec![0];
        for (step, dropped) in missing.iter().enumerate() {
            before.push(before[step] + dropped.count);
        }
        for marked in self.masked.iter_mut().chain([&mut self.filled]) {
            for at in marked {
                *at += before[missing.partition_point(|dropped| dropped.row < *at)];
            }
        }
        let new = missing.iter().zip(&before);
        let new = new.flat_map(|(Dropped { row, count }, before)| {
            (row + 1..=row + count).map(move |at| at + before)
        });
        self.filled.extend(new);
        self.filled.sort_unstable();
    }
}

/// A channel with values inserted into steps, given in ascending order: `value` takes the step's first row and the
/// share of the step that has passed.
fn with_rows(channel: &[f64], missing: &[Dropped], value: impl Fn(usize, f64) -> f64) -> Vec<f64> {
    let added: usize = missing.iter().map(|dropped| dropped.count).sum();
    let mut whole = Vec::with_capacity(channel.len() + added);
    let mut from = 0;
    for Dropped { row, count } in missing {
        whole.extend_from_slice(&channel[from..=*row]);
        let share = |k: usize| k as f64 / (*count as f64 + 1.0);
        whole.extend((1..=*count).map(|k| value(*row, share(k))));
        from = row + 1;
    }
    whole.extend_from_slice(&channel[from..]);
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 s at 100 Hz of which the rows 300, 301 and 700 are missing.
    fn log(tau: fn(f64) -> f64) -> Log {
        let rows = (0..1000).filter(|row| ![300, 301, 700].contains(row));
        let time: Vec<f64> = rows.map(|row| f64::from(row) * 0.01).collect();
        let of = |f: fn(f64) -> f64| vec![time.iter().map(|t| f(*t)).collect()];
        Log {
            q: of(|t| (3.0 * t).sin()),
            qd: of(|t| 3.0 * (3.0 * t).cos()),
            tau: of(tau),
            masked: vec![vec![10, 800]],
            time,
            ..Log::empty(1)
        }
    }

    #[test]
    fn a_smooth_torque_is_continued_over_missing_rows() {
        let full = log(|t| (2.0 * t).cos()).completed(0.5);
        assert_eq!((full.rows(), full.leave_out.len()), (1000, 0));
        assert_eq!(
            (full.masked, full.filled),
            (vec![vec![10, 803]], vec![300, 301, 700])
        );
        for row in [300, 301, 700] {
            let t = f64::from(u16::try_from(row).unwrap()) * 0.01;
            assert!((full.time[row] - t).abs() < 1e-9);
            assert!((full.q[0][row] - (3.0 * t).sin()).abs() < 1e-5);
            assert!((full.tau[0][row] - (2.0 * t).cos()).abs() < 1e-3);
        }
    }

    #[test]
    fn a_torque_that_jumps_while_rows_are_missing_leaves_the_step_out() {
        let steps = log(|t| if t > 3.0 { 1.0 } else { -1.0 });
        let full = steps.clone().completed(0.5);
        let [start_s, end_s] = [2.99, 3.02];
        assert_eq!(full.leave_out, [Interval { start_s, end_s }]);
        // Little else would remain.
        assert!(steps.completed(20.0).leave_out.is_empty());
    }

    #[test]
    fn jitter_and_gaps_are_no_dropped_rows() {
        let mut jittery = log(|_| 0.0);
        let rows = jittery.rows();
        let late = |i: usize| 0.01 * (i as f64 + 0.3 * (i % 2) as f64);
        jittery.time = (0..rows).map(late).collect();
        assert!(dropped(&jittery).is_empty());
        jittery.time.iter_mut().skip(500).for_each(|t| *t += 1.0);
        assert!(dropped(&jittery).is_empty());
    }
}
