//! The motion of a log as the torque error uses it: resampled at even steps, low-pass filtered, differentiated.

use std::ops::{Range, RangeInclusive};

use super::direction::{directions, directions_over_steps};
use super::instant::{ROUNDING, SAME_S, row_after, row_from};
use super::log::Log;
use super::low_pass::LowPass;
use super::measured::Measured;
use super::standstill::rests;
use super::torque_column::TorqueColumn;
use crate::limits::log_steps;

/// Hz
const CUTOFF_HZ: f64 = 10.0;
/// Highest cutoff as a share of half the sampling rate.
const HIGHEST: f64 = 0.2;
/// Time between rows that are fitted, s: a fifth of the period at the cutoff.
const ROWS_S: f64 = 0.02;
/// Beyond this many periods of the cutoff, the filter knows nothing of a value: 1e-10 of it is left.
const SETTLED: f64 = 10.0;
/// Time at either end of a log that is not used: the filter knows nothing beyond the ends, s.
const ENDS_S: f64 = 0.5;

/// Channels of a log at even steps, `[joint][row]`, in which nothing moves faster than the filter passes.
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
    /// The further measured columns of the log.
    pub measured: Vec<Measured>,
    /// Signs of the velocities, smoothed over a width and filtered like the torques: what remains of friction that
    /// jumps. Empty if no widths are given.
    pub directions: Vec<Vec<f64>>,
    /// Whether each joint rests.
    pub rests: Vec<Vec<bool>>,
}

/// Differences of an even channel at a row, by the values up to two rows before and after it.
#[derive(Debug)]
struct Stencils {
    slope: [f64; 5],
    curvature: [f64; 5],
}

/// Central differences, exact to second order in the step.
static CENTRAL: Stencils = Stencils {
    slope: [0.0, -0.5, 0.0, 0.5, 0.0],
    curvature: [0.0, 1.0, -2.0, 1.0, 0.0],
};

/// Exact to fourth order. At a hundred rows a second, central differences take one percent off a velocity at 4 Hz.
static FOURTH_ORDER: Stencils = Stencils {
    slope: [1.0 / 12.0, -2.0 / 3.0, 0.0, 2.0 / 3.0, -1.0 / 12.0],
    curvature: [-1.0 / 12.0, 4.0 / 3.0, -2.5, 4.0 / 3.0, -1.0 / 12.0],
};

impl Stencils {
    /// Rows that a difference needs on either side.
    const REACH: usize = 2;

    fn at(of: &[f64; 5], channel: &[f64], row: usize) -> f64 {
        let around = &channel[row - Self::REACH..=row + Self::REACH];
        of.iter()
            .zip(around)
            .map(|(share, value)| share * value)
            .sum()
    }
}

/// Where along a log its channels are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Places {
    Rows,
    /// In the middles of the steps, as means over each step: what is held over a step needs no interpolation then, which
    /// would take a share of fast commands away.
    Steps,
}

/// How the channels of a log are smoothed, and which rows of them are used.
#[derive(Debug, Clone)]
pub struct Smoothing {
    step_s: f64,
    places: Places,
    stencils: &'static Stencils,
    /// As a share of the sampling rate.
    cutoff: f64,
    filter: LowPass,
    /// Times of the log, s.
    logged: Vec<f64>,
    /// The middle of each step of the log, s: where a torque that is held over it acts.
    middle: Vec<f64>,
    /// Even times, s.
    even: Vec<f64>,
    /// Rows at even times that are used.
    used: Vec<usize>,
}

impl Smoothing {
    /// Smoothing at the median step of a log, without half a second at either end and without left-out intervals: linear
    /// interpolation and central differences, as the torque error is defined.
    pub fn of(log: &Log) -> Self {
        Self::at(log, Places::Rows, &CENTRAL)
    }

    /// The same for fits, more precisely: means of the angles over the steps beside torques that are held over them or are
    /// means themselves, and differences of fourth order.
    pub fn precise(log: &Log) -> Self {
        let places = match log.torque {
            TorqueColumn::Sampled => Places::Rows,
            TorqueColumn::Held | TorqueColumn::Mean => Places::Steps,
        };
        Self::at(log, places, &FOURTH_ORDER)
    }

    /// Whether the rows of a log are near enough for the cutoff of torques, which is lower for rows farther apart.
    pub fn passes_full_band(log: &Log) -> bool {
        CUTOFF_HZ * (log.median_step() - SAME_S) <= HIGHEST / 2.0
    }

    fn at(log: &Log, places: Places, stencils: &'static Stencils) -> Self {
        let step_s = log.median_step();
        let cutoff = (CUTOFF_HZ * step_s).min(HIGHEST / 2.0);
        let mut even = even(log, step_s);
        if places == Places::Steps {
            even.pop();
            even.iter_mut().for_each(|time| *time += 0.5 * step_s);
        }
        let inner = Stencils::REACH..even.len().saturating_sub(Stencils::REACH);
        Self {
            step_s,
            places,
            stencils,
            cutoff,
            filter: LowPass::new(cutoff),
            middle: middles(&log.time, step_s),
            logged: log.time.clone(),
            used: inner.filter(|row| is_used(log, even[*row])).collect(),
            even,
        }
    }

    /// Keeps every n-th row, with n small enough that these rows hold everything that the filter passes.
    #[must_use]
    pub fn thinned(self) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and small
        let every = ((ROWS_S / self.step_s).floor() as usize).max(1);
        Self {
            used: self.used.into_iter().step_by(every).collect(),
            ..self
        }
    }

    /// All of the log.
    pub fn whole(&self) -> Stretch {
        Stretch {
            logged: 0..self.logged.len(),
            even: 0..self.even.len(),
            used: 0..self.used.len(),
        }
    }

    /// What the used rows between two rows of the log depend on, if commands act for `memory_s` (s).
    pub fn stretch(&self, rows: &RangeInclusive<usize>, memory_s: f64) -> Stretch {
        let [from, to] = [rows.start(), rows.end()].map(|row| self.logged[*row]);
        let within =
            |times: &[f64], from: f64, to: f64| row_from(times, from)..row_after(times, to);
        let is_before = |row: &usize, time: f64| self.even[*row] < time - SAME_S;
        let settled_s = SETTLED / (self.cutoff / self.step_s);
        let even = within(&self.even, from - settled_s, to + settled_s);
        let logged = within(&self.logged, from - settled_s - memory_s, to + settled_s);
        Stretch {
            // The even times lie between these rows.
            logged: logged.start.saturating_sub(2)..(logged.end + 2).min(self.logged.len()),
            used: self.used.partition_point(|row| is_before(row, from))
                ..self.used.partition_point(|row| is_before(row, to)),
            even,
        }
    }

    /// Values that are held from each row of the log to the next, at the rows that are used.
    pub fn held(&self, values: &[f64]) -> Vec<f64> {
        self.used_of(&self.filtered(&self.middle, values))
    }

    /// The same for several channels over a stretch of the log; zero at rows outside it.
    pub fn held_in(&self, stretch: &Stretch, channels: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let Stretch { logged, even, used } = stretch;
        let at_even = |values: &Vec<f64>| {
            let (even, middle) = (&self.even[even.clone()], &self.middle[logged.clone()]);
            resampled(even.iter().copied(), middle, values).collect()
        };
        let read: Vec<Vec<f64>> = channels.iter().map(at_even).collect();
        let passed = self.filter.apply_to_all(&read).into_iter();
        let at_used = |passed: Vec<f64>| {
            let mut all = vec![0.0; self.used.len()];
            for row in used.clone() {
                all[row] = passed[self.used[row] - even.start];
            }
            all
        };
        passed.map(at_used).collect()
    }

    /// Channels with values at the rows of a stretch of the log, in the same way.
    pub fn sampled_in(&self, stretch: &Stretch, channels: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mean = |pair: &[f64]| 0.5 * (pair[0] + pair[1]);
        let means = |channel: &Vec<f64>| -> Vec<f64> {
            let steps = channel.windows(2).map(mean);
            steps.chain(channel.last().copied()).collect()
        };
        let means: Vec<Vec<f64>> = channels.iter().map(means).collect();
        self.held_in(stretch, &means)
    }

    /// The torques of a joint at the rows that are used, each taken at the time at which it acted.
    pub fn torques(&self, log: &Log, joint: usize) -> Vec<f64> {
        match log.torque {
            TorqueColumn::Sampled => self.used_of(&self.filtered(&self.logged, &log.tau[joint])),
            _ => self.held(&log.held_torques(joint)),
        }
    }

    /// The `logged` torques of all joints at the rows that are used; where a drive delivers other `means` from row to row
    /// over a stretch of the log, these in the same way.
    pub fn delivered(
        &self,
        log: &Log,
        stretch: &Stretch,
        (logged, means): (&[Vec<f64>], &[Option<Vec<f64>>]),
    ) -> Vec<Vec<f64>> {
        // Readings are finer than means between them, and equal where nothing is delayed.
        let is_added = log.torque == TorqueColumn::Sampled;
        let channel = |(joint, means): (usize, &Option<Vec<f64>>)| {
            let means = means.as_ref()?;
            if !is_added {
                return Some(means.clone());
            }
            let commanded = log.held_torques(joint);
            let both = means.iter().zip(&commanded[stretch.logged.clone()]);
            Some(both.map(|(mean, commanded)| mean - commanded).collect())
        };
        let channels: Vec<Vec<f64>> = means.iter().enumerate().filter_map(channel).collect();
        let mut filtered = self.held_in(stretch, &channels).into_iter();
        let of_joint = |(tau, means): (&Vec<f64>, &Option<Vec<f64>>)| match means
            .as_ref()
            .and_then(|_| filtered.next())
        {
            Some(added) if is_added => tau
                .iter()
                .zip(&added)
                .map(|(tau, added)| tau + added)
                .collect(),
            Some(delivered) => delivered,
            None => tau.clone(),
        };
        logged.iter().zip(means).map(of_joint).collect()
    }

    /// A channel with values at these times, filtered, at all even times.
    fn filtered(&self, times: &[f64], values: &[f64]) -> Vec<f64> {
        self.filter.apply(&self.at_even(times, values))
    }

    /// The angles of a joint, at all even times.
    fn angles(&self, q: &[f64]) -> Vec<f64> {
        match self.places {
            Places::Rows => self.at_even(&self.logged, q),
            Places::Steps => self.at_even(&self.middle, &step_means(&self.logged, q)),
        }
    }

    fn at_even(&self, times: &[f64], values: &[f64]) -> Vec<f64> {
        resampled(self.even.iter().copied(), times, values).collect()
    }

    fn used_of<T: Copy>(&self, all: &[T]) -> Vec<T> {
        self.used.iter().map(|row| all[*row]).collect()
    }
}

/// A part of a log that is smoothed by itself: its rows, the even times, and the rows that are used.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    pub logged: Range<usize>,
    even: Range<usize>,
    used: Range<usize>,
}

impl Smooth {
    /// The channels of a log at all rows that are used. Velocity and acceleration are central differences of the
    /// filtered angle.
    pub fn of(log: &Log) -> Self {
        Self::by(&Smoothing::of(log), log, &[])
    }

    /// A log with the direction of each joint, which reverses over these speeds, rad/s or m/s.
    pub fn by(smoothing: &Smoothing, log: &Log, widths: &[f64]) -> Self {
        let Smoothing {
            step_s,
            cutoff,
            filter,
            even,
            used,
            stencils,
            ..
        } = smoothing;
        let read: Vec<Vec<f64>> = log.q.iter().map(|q| smoothing.angles(q)).collect();
        let q: Vec<Vec<f64>> = read.iter().map(|q| filter.apply(q)).collect();
        // Angles a step.
        let speeds: Vec<Vec<f64>> = q.iter().map(|q| central_differences(q)).collect();
        let direction = |(speeds, width): (&Vec<f64>, &f64)| {
            let width = width.max(f64::MIN_POSITIVE) * step_s;
            let directions = match smoothing.places {
                Places::Rows => directions(speeds, width, log.torque),
                Places::Steps => directions_over_steps(speeds, width),
            };
            smoothing.used_of(&filter.apply(&directions))
        };
        let of_joints = read.iter().zip(&q).zip(&speeds);
        let at_rest = of_joints.map(|((read, q), speeds)| rests(read, q, speeds, *cutoff));
        let each = |value: &dyn Fn(&[f64], usize) -> f64| {
            let of = |q: &Vec<f64>| used.iter().map(|row| value(q, *row)).collect();
            q.iter().map(of).collect::<Vec<Vec<f64>>>()
        };
        let Stencils { slope, curvature } = stencils;
        Self {
            directions: speeds.iter().zip(widths).map(direction).collect(),
            rests: at_rest.map(|rests| smoothing.used_of(&rests)).collect(),
            qd: each(&|q, k| Stencils::at(slope, q, k) / step_s),
            qdd: each(&|q, k| Stencils::at(curvature, q, k) / step_s.powi(2)),
            q: each(&|q, k| q[k]),
            tau: (0..log.joints())
                .map(|joint| smoothing.torques(log, joint))
                .collect(),
            measured: (log.measured.iter())
                .map(|measured| Measured {
                    name: measured.name.clone(),
                    values: smoothing.held(&measured.values),
                })
                .collect(),
            time: smoothing.used_of(even),
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.time.len()
    }
}

/// Half the difference of the values on either side of each row: at either end, that of the row beside it.
pub(super) fn central_differences(channel: &[f64]) -> Vec<f64> {
    let inner: Vec<f64> = (channel.windows(3))
        .map(|three| 0.5 * (three[2] - three[0]))
        .collect();
    let ends = [inner.first(), inner.last()].map(|end| end.copied().unwrap_or(0.0));
    [&ends[..1], &inner, &ends[1..]].concat()
}

/// The middle of the step after each row; the last one has the median length.
fn middles(time: &[f64], step_s: f64) -> Vec<f64> {
    let inner = time.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
    let last = time.last().map(|last| last + 0.5 * step_s);
    inner.chain(last).collect()
}

/// The means of a channel over the steps between its rows, the last one its last value: the trapezoidal rule, less its
/// error by the curvature there.
fn step_means(time: &[f64], channel: &[f64]) -> Vec<f64> {
    let steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let slopes = channel.windows(2).zip(&steps);
    let slopes: Vec<f64> = slopes
        .map(|(pair, step)| (pair[1] - pair[0]) / step)
        .collect();
    let curvature = |row: usize| match row {
        0 => 0.0,
        row if row >= slopes.len() => 0.0,
        row => 2.0 * (slopes[row] - slopes[row - 1]) / (steps[row] + steps[row - 1]),
    };
    let mean = |k: usize| {
        let bend = 0.5 * (curvature(k) + curvature(k + 1));
        0.5 * (channel[k] + channel[k + 1]) - steps[k].powi(2) / 12.0 * bend
    };
    let last = channel.last().copied();
    (0..steps.len()).map(mean).chain(last).collect()
}

/// Even steps over the log; none if the log, or the part of one, is nearly all pause.
fn even(log: &Log, step_s: f64) -> Vec<f64> {
    let is_dense = step_s > 0.0 && log.duration() <= log_steps(log.rows()) * step_s;
    let Some(first) = log.time.first().filter(|_| is_dense) else {
        return Vec::new();
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // positive, and no larger than a log
    let steps = (log.duration() / step_s + ROUNDING).floor() as usize;
    (0..=steps).map(|k| first + k as f64 * step_s).collect()
}

/// A channel at other times, given in ascending order, interpolated linearly between its rows.
pub(super) fn resampled(
    times: impl IntoIterator<Item = f64>,
    rows: &[f64],
    channel: &[f64],
) -> impl Iterator<Item = f64> {
    let mut row = 0;
    times.into_iter().map(move |time| {
        while row + 2 < rows.len() && rows[row + 1] < time {
            row += 1;
        }
        let share = (time - rows[row]) / (rows[row + 1] - rows[row]);
        channel[row] + share.clamp(0.0, 1.0) * (channel[row + 1] - channel[row])
    })
}

fn is_used(log: &Log, time: f64) -> bool {
    let (Some(first), Some(last)) = (log.time.first(), log.time.last()) else {
        return false;
    };
    let is_left_out = log.leave_out.iter().any(|span| span.touches(time, time));
    let from_ends = (time - first).min(last - time);
    from_ends >= ENDS_S - SAME_S && !is_left_out
}

#[cfg(test)]
mod tests {
    use super::{Smooth, Smoothing};
    use crate::data::{Interval, Log, TorqueColumn};

    /// The torque is the cosine, whatever the column holds of it.
    #[test]
    fn a_slow_sine_is_differentiated_twice() {
        let mean =
            |from: f64, to: f64| ((3.0 * to).sin() - (3.0 * from).sin()) / (3.0 * (to - from));
        smooths(TorqueColumn::Held, &|t| mean(t, t + 0.001));
        smooths(TorqueColumn::Sampled, &|t| (3.0 * t).cos());
        smooths(TorqueColumn::Mean, &|t| mean(t - 0.001, t));
    }

    fn smooths(column: TorqueColumn, torque: &dyn Fn(f64) -> f64) {
        let mut log = Log::empty(1).with_torques(column);
        for k in 0..4000 {
            let t = 0.001 * f64::from(k);
            log.time.push(t);
            log.q[0].push((3.0 * t).sin());
            log.qd[0].push(0.0);
            log.tau[0].push(torque(t));
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

    #[test]
    fn a_hundred_rows_a_second_pass_what_the_filter_does() {
        let passes = |step_s: f64| {
            let log = Log {
                time: (0..50).map(|k| 7.3 + step_s * f64::from(k)).collect(),
                ..Log::empty(1)
            };
            Smoothing::passes_full_band(&log)
        };
        assert!(passes(0.005) && passes(0.01));
        assert!(!passes(0.0125) && !passes(1.0 / 14.0));
    }

    /// A part of a log that is smoothed by itself reads as the whole does.
    #[test]
    fn a_stretch_is_smoothed_as_the_whole() {
        let time: Vec<f64> = (0..3000).map(|k| 0.005 * f64::from(k)).collect();
        let channel: Vec<f64> = time
            .iter()
            .map(|t| (9.0 * t).sin() + (70.0 * t).cos())
            .collect();
        let log = Log {
            q: vec![channel.clone()],
            qd: vec![channel.clone()],
            tau: vec![channel.clone()],
            time,
            ..Log::empty(1)
        };
        let smoothing = Smoothing::precise(&log).thinned();
        let stretch = smoothing.stretch(&(1200..=1400), 0.1);
        let part = channel[stretch.logged.clone()].to_vec();
        assert!(part.len() < 900, "{} rows", part.len());
        let [part, whole] = [
            smoothing.held_in(&stretch, &[part]),
            smoothing.held_in(&smoothing.whole(), &[channel]),
        ];
        let rows = stretch.used.clone();
        assert!(rows.len() > 40, "{rows:?}");
        for row in rows {
            assert!((part[0][row] - whole[0][row]).abs() < 1e-9, "row {row}");
        }
    }
}
