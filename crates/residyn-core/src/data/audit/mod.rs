//! What a log is good for: units, signs, sampling, noise, jumps, lags and excitation, measured before any fit.
//!
//! The audit reads the log alone and, of the model, only the names of its columns. It changes nothing: findings are
//! reported, and the fit decides. Left-out intervals are read like all others.

mod as_one;
mod channel;
mod compare;
mod demand;
mod findings;
mod intervals;
mod joint;
mod misread;
mod motion;
mod quality;
mod regression;
mod repeats;
mod response;
mod rest;

mod table;

pub(crate) use as_one::moves_as_one;
pub use channel::Channel;
pub use compare::{MAX_LAG_S, TorqueLag, VelocityCheck};
pub use demand::TorqueDemand;
pub use joint::JointAudit;
pub(crate) use misread::reversed_driving;
pub use quality::{Audit, Finding, Remedy, Severity};
pub use repeats::{Repeated, report_repeats};
pub use response::Response;

use std::ops::Range;

use self::misread::Reading;
use super::columns::Columns;
use super::dropped::{dropped, is_gap};
use super::examined::examined;
use super::log::{Interval, Log};
use super::signal::differences;
use super::statistics::{deviation, median};

/// Measures the quality of a log that was read from these columns.
///
/// The numbers are those of the log as it was read, without repeated readings. If columns hold something other than was
/// asked for, the first findings say so, and the others are about the log as it is meant.
///
/// Works on any log that [`Log::of_table`] returns; quantities that need more rows or more motion than
/// the log has are `None` or 0, as their documentation says.
pub fn audit(log: &Log, columns: &Columns) -> Audit {
    let [audit] = audit_together([log], columns)
        .try_into()
        .expect("one log has one audit");
    audit
}

/// Measures the quality of logs that are used together, as [`audit`] does for one log: a joint may rest in one log and
/// move in another.
pub fn audit_together<'l>(
    logs: impl IntoIterator<Item = &'l Log>,
    columns: &Columns,
) -> Vec<Audit> {
    let logs: Vec<&Log> = logs.into_iter().collect();
    let mut audits: Vec<Audit> = logs.iter().map(|log| of_log(log, columns)).collect();
    rest::report_rest(&mut audits);
    as_one::report_as_one(&logs, &mut audits);
    audits
}

/// The audit of a log by itself.
fn of_log(log: &Log, columns: &Columns) -> Audit {
    let (mended, repeated) = log.without_repeats();
    let read = Reading::of(mended, columns);
    let (meant, misread) = misread::as_meant(&read, columns);
    let mut audit = measured(log, read.joints);
    let findings = match meant {
        Some(Reading { log, joints, .. }) => findings::of(&measured(&log, joints), &log),
        None => findings::of(&audit, &read.log),
    };
    let repeated = findings::repeated_readings(log, &repeated);
    audit.findings = [misread, findings, Vec::from_iter(repeated)].concat();
    audit.findings.sort_by_key(|finding| finding.severity);
    audit
}

/// The numbers of an audit.
fn measured(log: &Log, joints: Vec<JointAudit>) -> Audit {
    let mut steps = differences(&log.time);
    let median_step_s = median(&steps);
    let min_step_s = steps.iter().copied().reduce(f64::min).unwrap_or(0.0);
    let max_step_s = steps.iter().copied().reduce(f64::max).unwrap_or(0.0);
    let is_gap = |step: f64| is_gap(step, median_step_s);
    let gap = |pair: &[f64]| Interval {
        start_s: pair[0],
        end_s: pair[1],
    };
    let gaps = log.time.windows(2).filter(|pair| is_gap(pair[1] - pair[0]));
    steps.retain(|step| !is_gap(*step));
    Audit {
        log: log.name(),
        rows: log.rows(),
        examined_rows: examined(log.rows()).iter().map(Range::len).sum(),
        duration_s: log.duration(),
        median_step_s,
        min_step_s,
        max_step_s,
        jitter: relative_deviation(&steps, median_step_s),
        gaps: gaps.map(gap).collect(),
        dropped_rows: dropped(log).iter().map(|dropped| dropped.count).sum(),
        driven_by: log.driven_by,
        joints,
        repeats: None,
        findings: vec![],
    }
}

/// Standard deviation of the steps over their median; 0 for no steps.
fn relative_deviation(steps: &[f64], median_step_s: f64) -> f64 {
    if steps.is_empty() {
        return 0.0;
    }
    deviation(steps) / median_step_s
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn audit(log: &Log) -> Audit {
        super::audit(log, &Columns::default())
    }

    pub(super) fn one_joint(time: Vec<f64>, q: Vec<f64>, qd: Vec<f64>, tau: Vec<f64>) -> Log {
        Log {
            path: "rig.csv".into(),
            time,
            q: vec![q],
            qd: vec![qd],
            tau: vec![tau],
            ..Log::empty(1)
        }
    }

    pub(super) fn uniform(rows: usize, step_s: f64) -> Vec<f64> {
        (0..rows).map(|row| row as f64 * step_s).collect()
    }

    /// Replaces each value of a channel, given its row.
    pub(super) fn each(channel: &mut [f64], value: impl Fn(usize, f64) -> f64) {
        let rows = channel.iter_mut().enumerate();
        rows.for_each(|(row, x)| *x = value(row, *x));
    }

    /// Two joints on sines of these amplitudes and this frequency, at 100 Hz.
    pub(super) fn two_sines(name: &str, rows: usize, amplitudes: [f64; 2], frequency: f64) -> Log {
        let time = uniform(rows, 0.01);
        let over = |size: f64, f: fn(f64) -> f64| {
            let values = time.iter().map(|t| size * f(frequency * t));
            values.collect::<Vec<f64>>()
        };
        Log {
            path: name.into(),
            q: amplitudes.map(|size| over(size, f64::sin)).into(),
            qd: amplitudes
                .map(|size| over(size * frequency, f64::cos))
                .into(),
            tau: amplitudes.map(|size| over(size, f64::cos)).into(),
            time,
            ..Log::empty(2)
        }
    }

    /// The swing with a change.
    pub(super) fn edited(change: impl FnOnce(&mut Log)) -> Log {
        let mut log = swing();
        change(&mut log);
        log
    }

    /// A swing q = sin(3t) + 0.4 sin(7.3t) whose torque is its acceleration, sampled at 500 Hz.
    pub(super) fn swing() -> Log {
        let time = uniform(5000, 0.002);
        let over = |f: fn(f64) -> f64| time.iter().map(|t| f(*t)).collect();
        let q = over(|t| (3.0 * t).sin() + 0.4 * (7.3 * t).sin());
        let qd = over(|t| 3.0 * (3.0 * t).cos() + 2.92 * (7.3 * t).cos());
        let tau = over(|t| -9.0 * (3.0 * t).sin() - 21.316 * (7.3 * t).sin());
        one_joint(time, q, qd, tau)
    }

    #[test]
    fn sampling_is_measured_apart_from_gaps() {
        let audit = audit(&edited(|log| {
            log.time[2500..].iter_mut().for_each(|t| *t += 0.2)
        }));
        assert_eq!(audit.gaps.len(), 1);
        assert!((audit.gaps[0].length_s() - 0.202).abs() < 1e-9);
        assert!(audit.jitter < 1e-9 && (audit.max_step_s - 0.202).abs() < 1e-9);
    }

    #[test]
    fn short_and_constant_logs_are_audited() {
        for rows in [2, 3, 5, 10, 30] {
            let (time, level) = (uniform(rows, 0.01), |value| vec![value; rows]);
            let still = one_joint(time.clone(), level(1.0), level(0.0), level(0.0));
            let ramp = one_joint(time, uniform(rows, 0.1), level(10.0), level(1.0));
            for log in [still, ramp] {
                let audit = audit(&log);
                assert!(!audit.findings.is_empty());
                assert!(!audit.to_string().contains("NaN"), "{audit}");
            }
        }
    }

    #[test]
    fn a_clock_that_jumps_by_years_costs_no_memory() {
        let audit = audit(&edited(|log| {
            log.time[2500..].iter_mut().for_each(|t| *t += 1e9)
        }));
        assert_eq!((audit.gaps.len(), audit.joints[0].velocity), (1, None));
    }

    #[test]
    fn irregular_sampling_is_audited() {
        let late = |row: usize| 0.0009 * ((row * 7919) % 13) as f64 / 13.0;
        let log = edited(|log| each(&mut log.time, |row, t| t + late(row)));
        assert!(audit(&log).jitter > 0.1);
    }
}
