//! The intervals that certain rows of a log form.

use crate::data::log::{Interval, Log};

/// Rows with fewer rows than this between them belong to one interval.
const CLOSE_ROWS: usize = 10;

impl Log {
    /// The intervals of these rows, given in ascending order; each ends where its last row does.
    pub(super) fn intervals(&self, rows: impl IntoIterator<Item = usize>) -> Vec<Interval> {
        let mut intervals: Vec<[usize; 2]> = Vec::new();
        for row in rows {
            match intervals.last_mut() {
                Some([_, last]) if row - *last <= CLOSE_ROWS => *last = row,
                _ => intervals.push([row, row]),
            }
        }
        let interval = |[first, last]: [usize; 2]| Interval {
            start_s: self.time[first],
            end_s: self.time[(last + 1).min(self.rows() - 1)],
        };
        intervals.into_iter().map(interval).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::swing;

    #[test]
    fn rows_close_to_each_other_are_one_stretch() {
        let log = swing();
        let found = log.intervals([3, 4, 12, 500, 4999]);
        let ends: Vec<[f64; 2]> = found.iter().map(|s| [s.start_s, s.end_s]).collect();
        let of_rows = [[3, 13], [500, 501], [4999, 4999]];
        assert_eq!(ends, of_rows.map(|rows| rows.map(|row| log.time[row])));
        assert!(log.intervals([]).is_empty());
    }
}
