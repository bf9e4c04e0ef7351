use crate::data::{Log, half_width_s, is_gap, local_cubic, row_after};

/// A piece of one log, rows `first..=last`, over which a model is integrated open loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Index of the log.
    pub log: usize,
    pub first: usize,
    pub last: usize,
}

impl Window {
    /// Number of rows, including the first and the last.
    pub fn rows(&self) -> usize {
        self.last - self.first + 1
    }

    /// Time from the first row to the last in s.
    pub fn duration_s(&self, logs: &[Log]) -> f64 {
        let time = &logs[self.log].time;
        time[self.last] - time[self.first]
    }

    /// Time of the first row in s.
    pub fn start_s(&self, logs: &[Log]) -> f64 {
        logs[self.log].time[self.first]
    }
}

/// Consecutive windows of `length_s` seconds in all logs. No window spans a gap or touches a left-out interval, and
/// each begins where the state can be estimated from the log.
pub fn cut(logs: &[Log], length_s: f64) -> Vec<Window> {
    let mut windows = Vec::new();
    for (index, log) in logs.iter().enumerate() {
        let step_s = log.median_step();
        let mut first = 0;
        while first + 1 < log.rows() {
            match window_at(log, step_s, first, length_s) {
                Ok(last) => {
                    windows.push(Window {
                        log: index,
                        first,
                        last,
                    });
                    first = last;
                }
                Err(next) => first = next,
            }
        }
    }
    windows
}

/// The last row of the window that begins at `first`; if there is none, the next row at which one may begin, as an
/// error.
fn window_at(log: &Log, step_s: f64, first: usize, length_s: f64) -> Result<usize, usize> {
    // Half a step of tolerance, because logged times are rounded decimals.
    let end = log.time[first] + length_s + 0.5 * step_s;
    let last = log.time.partition_point(|t| *t <= end) - 1;
    // Rows further apart than the length do not make a window.
    if last == first || log.time[last] < log.time[first] + length_s - 0.5 * step_s {
        return Err(last + 1);
    }
    let (from, to) = (log.time[first], log.time[last]);
    if let Some(span) = log.leave_out.iter().find(|span| span.touches(from, to)) {
        return Err(row_after(&log.time, span.end_s).max(first + 1));
    }
    let gap = (first..last).find(|&row| is_gap(log.time[row + 1] - log.time[row], step_s));
    if let Some(row) = gap {
        return Err(row + 1);
    }
    initial_state(log, half_width_s(step_s), first)
        .map(|_| last)
        .ok_or(first + 1)
}

/// Positions, then velocities at a row, estimated from the logged positions within `half_width_s` (see
/// [`half_width_s`]). `None` near the ends of the log.
pub fn initial_state(log: &Log, half_width_s: f64, row: usize) -> Option<Vec<f64>> {
    let fits: Option<Vec<_>> = log
        .q
        .iter()
        .map(|q| local_cubic(&log.time, q, row, half_width_s))
        .collect();
    fits.map(|fits| {
        let angles = fits.iter().map(|fit| fit.value);
        let velocities = fits.iter().map(|fit| fit.slope);
        angles.chain(velocities).collect()
    })
}
