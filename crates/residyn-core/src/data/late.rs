//! Channels on other clocks, whose values were taken a given time before the times of their rows.

use super::instant::{row_after, row_from};
use super::log::Log;
use super::smooth::resampled;

/// The values at the times of the rows, interpolated linearly between those that were taken `late_s` before them.
pub(super) fn undone(time: &[f64], channel: Vec<f64>, late_s: f64) -> Vec<f64> {
    if late_s == 0.0 {
        return channel;
    }
    let wanted = time.iter().map(|time| time + late_s);
    resampled(wanted, time, &channel).collect()
}

/// The rows of a log for which all channels have values, given these delays.
pub(super) fn cut(log: Log, late_s: impl IntoIterator<Item = f64>) -> Log {
    let ends = |(early, late): (f64, f64), late_s: f64| (early.min(late_s), late.max(late_s));
    let (early, late) = late_s.into_iter().fold((0.0, 0.0), ends);
    let (Some(first), Some(last)) = (log.time.first(), log.time.last()) else {
        return log;
    };
    if early == 0.0 && late == 0.0 {
        return log;
    }
    let begin = row_from(&log.time, first - early);
    let end = row_after(&log.time, last - late).max(begin);
    log.at(std::slice::from_ref(&(begin..end)))
}

#[cfg(test)]
mod tests {
    use super::{cut, undone};
    use crate::data::Log;

    #[test]
    fn a_late_channel_is_moved_to_when_its_values_were_taken() {
        let truth = |t: f64| 3.0 * t - 1.0;
        for late_s in [0.0, 0.004, 0.03, -0.025] {
            let mut log = Log::empty(1);
            log.time = (0..100).map(|row| 0.01 * f64::from(row)).collect();
            let logged = log.time.iter().map(|t| truth(t - late_s)).collect();
            log.q = vec![undone(&log.time, logged, late_s)];
            log.qd = vec![log.time.clone()];
            log.tau = vec![log.time.clone()];
            let log = cut(log, [late_s, 0.0]);
            assert!(log.rows() >= 96 && log.q[0].len() == log.rows());
            let mut rows = log.time.iter().zip(&log.q[0]);
            assert!(rows.all(|(t, x)| (x - truth(*t)).abs() < 1e-12), "{late_s}");
        }
    }
}
