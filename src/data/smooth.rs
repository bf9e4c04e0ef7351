//! The motion of a log as the torque error reads it: even steps, low-pass filtered, differentiated.

use super::log::Log;
use super::low_pass::LowPass;

/// Hz
const CUTOFF_HZ: f64 = 10.0;
/// Highest cutoff as a share of half the sampling rate.
const HIGHEST: f64 = 0.2;
/// Time between rows that are fitted, s: a fifth of the period of what just passes.
const ROWS_S: f64 = 0.02;
/// Time at either end of a log that is not used: the filter knows nothing beyond the ends, s.
const ENDS_S: f64 = 0.5;

/// Channels of a log at even steps, `[joint][row]`, in which nothing moves faster than the filter lets through.
#[derive(Debug, Clone, PartialEq)]
pub struct Smooth {
    /// s
    pub time: Vec<f64>,
    /// rad or m
    pub q: Vec<Vec<f64>>,
    pub qd: Vec<Vec<f64>>,
    pub qdd: Vec<Vec<f64>>,
    /// N m or N
    pub tau: Vec<Vec<f64>>,
    /// Signs of the velocities, smoothed over a width and filtered like the torques: what is left of friction that jumps.
    /// Empty where no widths are given.
    pub directions: Vec<Vec<f64>>,
}

impl Smooth {
    /// The log at its median step, without half a second at either end and without the intervals that are left out. Velocity
    /// and acceleration are central differences of the filtered angle.
    pub fn of(log: &Log) -> Self {
        Self::with_directions(log, &[])
    }

    /// The same with the direction of each joint, which reverses over these speeds, rad/s or m/s.
    pub fn with_directions(log: &Log, widths: &[f64]) -> Self {
        let step_s = log.median_step();
        let cutoff = (CUTOFF_HZ * step_s).min(HIGHEST / 2.0);
        let filter = LowPass::new(cutoff);
        let time = even(log, step_s);
        let channel = |channel: &Vec<f64>| filter.apply(&resampled(&time, &log.time, channel));
        let channels = |channels: &[Vec<f64>]| channels.iter().map(channel).collect::<Vec<_>>();
        let (q, tau) = (channels(&log.q), channels(&log.tau));
        let direction = |(q, width): (&Vec<f64>, &f64)| {
            let speed = |pair: &[f64]| (pair[2] - pair[0]) / (2.0 * step_s);
            let inner = q.windows(3).map(speed);
            let signs: Vec<f64> = inner
                .map(|speed| (speed / width.max(f64::MIN_POSITIVE)).tanh())
                .collect();
            // One more at either end, like the rows.
            let ends = [signs.first(), signs.last()].map(|sign| sign.copied().unwrap_or(0.0));
            filter.apply(&[&ends[..1], &signs, &ends[1..]].concat())
        };
        let directions: Vec<Vec<f64>> = q.iter().zip(widths).map(direction).collect();
        let used: Vec<usize> = (1..time.len().saturating_sub(1))
            .filter(|row| is_used(log, time[*row]))
            .collect();
        let each = |channels: &[Vec<f64>], value: &dyn Fn(&[f64], usize) -> f64| {
            let of = |channel: &Vec<f64>| used.iter().map(|row| value(channel, *row)).collect();
            channels.iter().map(of).collect::<Vec<Vec<f64>>>()
        };
        Self {
            qd: each(&q, &|q, k| (q[k + 1] - q[k - 1]) / (2.0 * step_s)),
            qdd: each(&q, &|q, k| {
                (q[k + 1] - 2.0 * q[k] + q[k - 1]) / step_s.powi(2)
            }),
            q: each(&q, &|q, k| q[k]),
            tau: each(&tau, &|tau, k| tau[k]),
            directions: each(&directions, &|directions, k| directions[k]),
            time: used.iter().map(|row| time[*row]).collect(),
        }
    }

    /// Every so many rows that what is left still holds all that the filter lets through.
    #[must_use]
    pub fn thinned(&self, step_s: f64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and small
        let every = ((ROWS_S / step_s).floor() as usize).max(1);
        let channel = |channel: &Vec<f64>| channel.iter().copied().step_by(every).collect();
        let channels = |channels: &[Vec<f64>]| channels.iter().map(channel).collect();
        Self {
            time: channel(&self.time),
            q: channels(&self.q),
            qd: channels(&self.qd),
            qdd: channels(&self.qdd),
            tau: channels(&self.tau),
            directions: channels(&self.directions),
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.time.len()
    }
}

/// Even steps over the log.
fn even(log: &Log, step_s: f64) -> Vec<f64> {
    let Some(first) = log.time.first().filter(|_| step_s > 0.0) else {
        return Vec::new();
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // positive, and no larger than a log
    let steps = (log.duration() / step_s + 1e-9).floor() as usize;
    (0..=steps).map(|k| first + k as f64 * step_s).collect()
}

/// A channel at other times that rise, on straight lines between its rows.
pub(super) fn resampled(times: &[f64], rows: &[f64], channel: &[f64]) -> Vec<f64> {
    let mut row = 0;
    let value = |time: &f64| {
        while row + 2 < rows.len() && rows[row + 1] < *time {
            row += 1;
        }
        let share = (time - rows[row]) / (rows[row + 1] - rows[row]);
        channel[row] + share.min(1.0) * (channel[row + 1] - channel[row])
    };
    times.iter().map(value).collect()
}

fn is_used(log: &Log, time: f64) -> bool {
    let (Some(first), Some(last)) = (log.time.first(), log.time.last()) else {
        return false;
    };
    let left_out = log.leave_out.iter();
    let mut left_out = left_out.filter(|span| (span.start_s..=span.end_s).contains(&time));
    time >= first + ENDS_S && time <= last - ENDS_S && left_out.next().is_none()
}

#[cfg(test)]
mod tests {
    use super::Smooth;
    use crate::data::{Interval, Log};

    #[test]
    fn a_slow_sine_is_differentiated_twice() {
        let mut log = Log::empty(1);
        for k in 0..4000 {
            let t = 0.001 * f64::from(k);
            log.time.push(t);
            log.q[0].push((3.0 * t).sin());
            log.qd[0].push(0.0);
            log.tau[0].push((3.0 * t).cos());
        }
        log.leave_out = vec![Interval {
            start_s: 1.0,
            end_s: 1.5,
        }];
        let smooth = Smooth::of(&log);
        for (row, t) in smooth.time.iter().enumerate() {
            assert!((smooth.q[0][row] - (3.0 * t).sin()).abs() < 1e-4, "{t}");
            assert!(
                (smooth.qd[0][row] - 3.0 * (3.0 * t).cos()).abs() < 1e-3,
                "{t}"
            );
            assert!(
                (smooth.qdd[0][row] + 9.0 * (3.0 * t).sin()).abs() < 1e-1,
                "{t}"
            );
            assert!((smooth.tau[0][row] - (3.0 * t).cos()).abs() < 1e-4, "{t}");
        }
        assert!((0.49..0.51).contains(&smooth.time[0]));
        assert!(smooth.time.iter().all(|t| !(1.0..=1.5).contains(t)));
        assert!((2400..2510).contains(&smooth.rows()));
    }
}
