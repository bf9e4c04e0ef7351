//! Rows that repeat the readings of the row before while the joints move: a bus that answered with its last values.

use std::borrow::Cow;

use super::column::Quantity;
use super::examined::at_examined;
use super::jumps::interpolated;
use super::log::Log;
use super::signal::resolution;
use super::statistics::{SIGMA_PER_MAD, mad};

/// A joint that moves by fewer steps of its encoder, or deviations of its noise, from row to row may not have been seen
/// to move: rounding and noise make equal readings there by chance.
const VISIBLE_STEPS: f64 = 3.0;

/// Readings before and after that show how fast the joint moves.
const NEARBY: usize = 2;

/// Speeds before and after, relative to the speed over a repetition, between which the joint moved on evenly. A joint
/// that rested for a row has at least twice the speed afterwards, one that stops has next to none.
const EVEN: [f64; 2] = [0.5, 1.5];

/// A reading that stays for more rows is a frozen sensor: how the joint moved meanwhile is unknown.
const MOST_ROWS: usize = 10;

/// With a larger share of repeated rows in motion, the log is written faster than its source is read: another finding. A
/// channel that keeps its value in a larger share of the rows does so by itself.
const MANY: f64 = 0.2;

/// The gain of white noise's variance in third differences.
const THIRD_GAIN: f64 = 20.0;

impl Log {
    /// The log with repeated readings masked and interpolated between the fresh ones, and the rows that repeat. Commands
    /// are left as they are, if they came from the computer, not with the readings; so are torques, which noise changes
    /// as much from row to row as an old one is off.
    pub(super) fn without_repeats(&self) -> (Cow<'_, Log>, Vec<usize>) {
        let fresh = fresh_rows(self);
        let rows = repeated_rows(self, &fresh);
        if rows.is_empty() {
            return (Cow::Borrowed(self), rows);
        }
        let mut log = self.clone();
        let between = |channel: &[f64], row: usize| {
            let next = fresh.partition_point(|fresh| *fresh <= row);
            let around = [next - 2, next - 1, next, next + 1].map(|at| fresh[at]);
            interpolated(&self.time, channel, around, self.time[row])
        };
        let readings = log.q.iter_mut().chain(&mut log.qd);
        let readings = readings.zip(self.q.iter().chain(&self.qd));
        let is_command = self.driven_by == Quantity::Command;
        let commands = log.tau.iter_mut().zip(&self.tau);
        let commands =
            commands.filter(|(_, old)| is_command && came_with_readings(old, &rows, &fresh));
        for (new, old) in readings.chain(commands) {
            // A velocity from another source may be fresh.
            for &row in rows.iter().filter(|row| old[**row] == old[**row - 1]) {
                new[row] = between(old, row);
            }
        }
        log.masked.resize(self.joints(), Vec::new());
        for masked in &mut log.masked {
            masked.extend(&rows);
            masked.sort_unstable();
            masked.dedup();
        }
        (Cow::Owned(log), rows)
    }
}

/// Whether a command was logged with the readings: it keeps its value where they repeat, and nowhere else. The whole
/// row is an old one then.
fn came_with_readings(channel: &[f64], repeated: &[usize], fresh: &[usize]) -> bool {
    let keeps = |row: &&usize| **row > 0 && channel[**row] == channel[**row - 1];
    let share = |rows: &[usize]| rows.iter().filter(keeps).count() as f64 / rows.len() as f64;
    share(repeated) > 1.0 - MANY && share(fresh) < MANY
}

/// The rows in which the angle of any joint differs from the row before.
fn fresh_rows(log: &Log) -> Vec<usize> {
    let is_fresh = |row: &usize| *row == 0 || log.q.iter().any(|q| q[*row] != q[*row - 1]);
    (0..log.rows()).filter(is_fresh).collect()
}

fn repeated_rows(log: &Log, fresh: &[usize]) -> Vec<usize> {
    if fresh.len() == log.rows() {
        return vec![];
    }
    let visible =
        |q: &Vec<f64>| VISIBLE_STEPS * resolution(&at_examined(q)).max(fresh_noise(q, fresh));
    let visible: Vec<f64> = log.q.iter().map(visible).collect();
    let moves = |at: &usize| {
        let mut joints = log.q.iter().zip(&visible);
        joints.any(|(q, visible)| moves_evenly(&log.time, q, fresh, *at, *visible))
    };
    let inner = NEARBY..fresh.len().saturating_sub(NEARBY + 1);
    let moving: Vec<usize> = inner.filter(moves).collect();
    let rows: usize = moving.iter().map(|&at| fresh[at + 1] - fresh[at]).sum();
    let repeated = moving.iter().flat_map(|&at| fresh[at] + 1..fresh[at + 1]);
    let repeated: Vec<usize> = repeated.collect();
    match repeated.len() as f64 > MANY * rows as f64 {
        true => vec![],
        false => repeated,
    }
}

/// Standard deviation of white noise on an angle, from its third differences: over rows that are all fresh, as the jump
/// after a repetition is no noise. An upper bound if the rows are far apart relative to the motion.
fn fresh_noise(q: &[f64], fresh: &[usize]) -> f64 {
    let is_unbroken = |rows: &&[usize]| rows[4] - rows[0] == 4;
    let third = |rows: &[usize]| {
        (q[rows[4]] - 3.0 * q[rows[3]] + 3.0 * q[rows[2]] - q[rows[1]]) / THIRD_GAIN.sqrt()
    };
    let unbroken = fresh.windows(5).filter(is_unbroken);
    SIGMA_PER_MAD * mad(&unbroken.map(third).collect::<Vec<f64>>())
}

/// Whether an angle moves on from one fresh reading to the next as it does before and after, and visibly.
fn moves_evenly(time: &[f64], q: &[f64], fresh: &[usize], at: usize, visible: f64) -> bool {
    let speed = |from: usize, to: usize| {
        let (from, to) = (fresh[from], fresh[to]);
        (q[to] - q[from]) / (time[to] - time[from])
    };
    let rows = fresh[at + 1] - fresh[at];
    let moved = (q[fresh[at + 1]] - q[fresh[at]]).abs();
    let over = speed(at, at + 1);
    let is_even = |speed: f64| (EVEN[0]..=EVEN[1]).contains(&(speed / over));
    rows <= MOST_ROWS
        && moved > 0.0
        && moved >= visible * rows as f64
        && is_even(speed(at - NEARBY, at))
        && is_even(speed(at + 1, at + 1 + NEARBY))
}

/// The most rows that repeat one after the other.
pub(super) fn longest_run(rows: &[usize]) -> usize {
    let runs = rows.chunk_by(|row, next| row + 1 == *next);
    runs.map(<[usize]>::len).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const REPEATED: [usize; 6] = [100, 300, 301, 302, 505, 777];

    /// 10 s at 100 Hz of a swing that an encoder reads in steps of this size.
    fn swing(step: f64) -> Log {
        let time: Vec<f64> = (0..1000).map(|row| f64::from(row) * 0.01).collect();
        let q = time.iter().map(|t| ((2.0 * t).sin() / step).round() * step);
        Log {
            q: vec![q.collect()],
            qd: vec![time.iter().map(|t| 2.0 * (2.0 * t).cos()).collect()],
            tau: vec![time.clone()],
            time,
            ..Log::empty(1)
        }
    }

    #[test]
    fn repeated_readings_are_masked_and_the_torque_is_kept() {
        let exact = swing(1e-4);
        let mut log = exact.clone();
        for row in REPEATED {
            log.q[0][row] = log.q[0][row - 1];
            log.qd[0][row] = log.qd[0][row - 1];
        }
        let (mended, rows) = log.without_repeats();
        assert_eq!((&rows[..], longest_run(&rows)), (&REPEATED[..], 3));
        assert_eq!(
            (&mended.masked[0][..], &mended.tau),
            (&REPEATED[..], &log.tau)
        );
        for row in REPEATED {
            assert!((mended.q[0][row] - exact.q[0][row]).abs() < 3e-4, "{row}");
            assert!((mended.qd[0][row] - exact.qd[0][row]).abs() < 1e-3, "{row}");
        }
    }

    #[test]
    fn a_command_that_was_logged_with_the_readings_repeats_with_them() {
        let exact = Log {
            driven_by: Quantity::Command,
            ..swing(1e-4)
        };
        let repeat = |channel: &mut Vec<f64>| {
            for row in REPEATED {
                channel[row] = channel[row - 1];
            }
        };
        let mut log = exact.clone();
        for channel in [&mut log.q[0], &mut log.qd[0], &mut log.tau[0]] {
            repeat(channel);
        }
        let (mended, _) = log.without_repeats();
        for row in REPEATED {
            let is_near = (mended.tau[0][row] - exact.tau[0][row]).abs() < 1e-12;
            assert!(is_near, "{row}");
        }
        // A command that changes every other row may have been held.
        for row in 0..1000 {
            log.tau[0][row] = log.time[row - row % 2];
        }
        repeat(&mut log.tau[0]);
        assert_eq!(log.without_repeats().0.tau, log.tau);
    }

    #[test]
    fn noise_larger_than_the_steps_of_the_encoder_makes_no_repetition() {
        // Equal readings by chance in some 3 % of the rows; the joint moves by 0.02 rad a row at most.
        let mut log = swing(1e-3);
        let mut state = 1_u32;
        for q in &mut log.q[0] {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *q += f64::from(state >> 16) % 41.0 * 1e-3;
        }
        assert!(fresh_rows(&log).len() < 990);
        assert!(log.without_repeats().1.is_empty());
    }

    #[test]
    fn rest_and_a_coarse_encoder_are_no_repetitions() {
        assert!(swing(0.02).without_repeats().1.is_empty());
        let mut sticks = swing(1e-4);
        let held = sticks.q[0][290];
        sticks.q[0][290..330].fill(held);
        assert!(sticks.without_repeats().1.is_empty());
    }
}
