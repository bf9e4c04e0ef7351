//! The rows of a log that are examined for what its channels look like and how its joints move.

use std::borrow::Cow;
use std::ops::Range;

use super::local_cubic::half_width_s;
use super::log::{Interval, Log};
use super::measured::Measured;

/// Number of rows examined at most, four minutes at 1 kHz: more show the same and cost many times the memory of the
/// log.
const EXAMINED_ROWS: usize = 1 << 18;

/// Number of intervals from which the rows of a longer log are taken, spread evenly from its first row to its last.
const STRETCHES: usize = 8;

/// The examined intervals of a log with this many rows: one, except for long logs.
pub(super) fn examined(rows: usize) -> Vec<Range<usize>> {
    if rows <= EXAMINED_ROWS {
        return std::iter::once(0..rows).collect();
    }
    let length = EXAMINED_ROWS / STRETCHES;
    let first = |interval: usize| interval * (rows - length) / (STRETCHES - 1);
    let rows_of = |interval: usize| first(interval)..first(interval) + length;
    (0..STRETCHES).map(rows_of).collect()
}

/// The values at the examined rows, one interval after the other.
pub(super) fn at_examined(values: &[f64]) -> Cow<'_, [f64]> {
    match &*examined(values.len()) {
        [all] => Cow::Borrowed(&values[all.clone()]),
        intervals => {
            let intervals = intervals.iter().map(|rows| &values[rows.clone()]);
            Cow::Owned(intervals.collect::<Vec<_>>().concat())
        }
    }
}

impl Log {
    /// Whether it has more rows than are examined.
    pub fn is_long(&self) -> bool {
        self.rows() > EXAMINED_ROWS
    }

    /// The part of a long log that fits read: its examined intervals, without the rows near their ends, and a note that
    /// says so. Fits to all rows take hours and show no more.
    #[must_use]
    pub fn shortened(self) -> Log {
        if !self.is_long() {
            return self;
        }
        let intervals = examined(self.rows());
        let half_width_s = half_width_s(self.median_step());
        let rounded = |time_s: f64| (time_s * 1e6).round() / 1e6;
        let mut log = self.at(&intervals);
        let between = |pair: &[Range<usize>]| Interval {
            start_s: rounded(self.time[pair[0].end - 1] - half_width_s),
            end_s: rounded(self.time[pair[1].start] + half_width_s),
        };
        log.leave_out.extend(intervals.windows(2).map(between));
        log.notes.push(format!(
            "fits and errors use {EXAMINED_ROWS} of its {} rows, in {STRETCHES} intervals spread evenly over it",
            self.rows()
        ));
        log
    }

    /// The rows of these ranges, given in ascending order.
    pub(crate) fn at(&self, ranges: &[Range<usize>]) -> Log {
        let cut = |column: &Vec<f64>| {
            let parts = ranges.iter().map(|rows| &column[rows.clone()]);
            parts.collect::<Vec<_>>().concat()
        };
        let begins = ranges.iter().scan(0, |sum, rows| {
            let begin = *sum;
            *sum += rows.len();
            Some((rows, begin))
        });
        let begins: Vec<(&Range<usize>, usize)> = begins.collect();
        let marked = |all: &Vec<usize>| {
            let place = |row: &usize| {
                let (rows, begin) = begins.iter().find(|(rows, _)| rows.contains(row))?;
                Some(begin + row - rows.start)
            };
            all.iter().filter_map(place).collect()
        };
        Log {
            is_qd_derived: self.is_qd_derived,
            path: self.path.clone(),
            time: cut(&self.time),
            q: self.q.iter().map(cut).collect(),
            qd: self.qd.iter().map(cut).collect(),
            tau: self.tau.iter().map(cut).collect(),
            driven_by: self.driven_by,
            torque: self.torque,
            measured: (self.measured.iter())
                .map(|measured| Measured {
                    name: measured.name.clone(),
                    values: cut(&measured.values),
                })
                .collect(),
            masked: self.masked.iter().map(marked).collect(),
            filled: marked(&self.filled),
            leave_out: self.leave_out.clone(),
            values: self.values.clone(),
            notes: self.notes.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_log_is_examined_from_its_first_row_to_its_last() {
        for rows in [500, EXAMINED_ROWS] {
            let intervals = examined(rows);
            assert_eq!((intervals.len(), &intervals[0]), (1, &(0..rows)));
        }
        for rows in [EXAMINED_ROWS + 1, 10_000_000] {
            let intervals = examined(rows);
            let whole = intervals[0].start..intervals[STRETCHES - 1].end;
            assert_eq!(whole, 0..rows);
            let mut pairs = intervals.windows(2);
            assert!(pairs.all(|pair| pair[0].end <= pair[1].start));
            let values: Vec<f64> = (0..rows).map(|row| row as f64).collect();
            assert_eq!(at_examined(&values).len(), EXAMINED_ROWS);
        }
    }

    #[test]
    fn what_fits_read_of_a_long_log_is_left_where_it_was() {
        let mut log = Log::empty(1);
        log.time = (0..400_000).map(|row| 0.001 * f64::from(row)).collect();
        for channel in [&mut log.q[0], &mut log.qd[0], &mut log.tau[0]] {
            channel.clone_from(&log.time);
        }
        log.masked[0] = vec![0, 40_000, 399_999];
        let short = log.at(&examined(400_000)).shortened();
        assert!(short.leave_out.is_empty() && short.notes.is_empty());
        let log = log.shortened();
        assert_eq!(log.rows(), EXAMINED_ROWS);
        assert_eq!(log.leave_out.len(), STRETCHES - 1);
        assert!(log.time == log.q[0] && log.time == log.tau[0]);
        assert_eq!(log.masked[0], [0, EXAMINED_ROWS - 1]);
        assert_eq!(log.time[EXAMINED_ROWS - 1], 399.999);
        assert!(log.notes[0].contains("262144 of its 400000 rows"));
        // No window begins or ends at the end of an interval, except at the ends of the log.
        let pauses = log.time.windows(2).filter(|pair| pair[1] - pair[0] > 0.01);
        let holds = |span: &Interval, time: f64| span.start_s < time && time < span.end_s;
        let is_left_out = |time: &f64| log.leave_out.iter().any(|span| holds(span, *time));
        assert_eq!(pauses.clone().count(), STRETCHES - 1);
        assert!(pauses.flatten().all(is_left_out));
    }
}
