use super::quality::{Audit, Finding, Severity};
use super::table::short;
use crate::data::log::Log;
use crate::data::smooth::resampled;
use crate::data::statistics::deviation;

/// Logs repeat each other if their angles differ by less than this share of their motion, root mean square: the error
/// of a controller that follows the same reference twice.
const SAME: f64 = 0.02;

/// No encoder repeats a motion as closely as this: the file is the same.
const IDENTICAL: f64 = 1e-9;

/// A log that is shorter than this share of another repeats only a part of it.
const WHOLE: f64 = 0.8;

/// An earlier log with the same motion.
#[derive(Debug, Clone, Copy)]
pub struct Repeated {
    /// Its place among the logs.
    pub place: usize,
    /// Root mean square difference of the angles, as a share of the motion.
    share: f64,
}

impl Repeated {
    /// Whether the two are the same log rather than two logs of the same motion.
    pub fn is_identical(&self) -> bool {
        self.share < IDENTICAL
    }
}

/// Report for each log which earlier one has the same motion, and return that one: as a test of the other, it shows how
/// well torques repeat, and nothing about other motions. An identical log takes precedence over one that only moves
/// alike.
pub fn report_repeats<'l>(
    logs: impl IntoIterator<Item = &'l Log>,
    audits: &mut [Audit],
) -> Vec<Option<Repeated>> {
    let logs: Vec<&Log> = logs.into_iter().collect();
    let repeated: Vec<Option<Repeated>> = (0..logs.len())
        .map(|place| repeated(&logs[..place], logs[place]))
        .collect();
    for (repeated, audit) in repeated.iter().zip(audits) {
        if let Some(repeated) = repeated {
            let name = logs[repeated.place].name();
            audit.add(finding(&name, repeated));
            audit.repeats = Some(name);
        }
    }
    repeated
}

fn repeated(before: &[&Log], log: &Log) -> Option<Repeated> {
    let moves = motion(log);
    let alike = |(place, other): (usize, &&Log)| {
        let share = difference(log, moves, other)?;
        Some(Repeated { place, share })
    };
    let mut alike = before.iter().enumerate().filter_map(alike);
    let first = alike.next()?;
    let identical = std::iter::once(first)
        .chain(alike)
        .find(Repeated::is_identical);
    Some(identical.unwrap_or(first))
}

fn finding(name: &str, repeated: &Repeated) -> Finding {
    if repeated.is_identical() {
        let text = format!(
            "every angle equals that of {name}: this is the same log again, and it cannot test a model fitted to the \
             other"
        );
        return Finding::new(Severity::Serious, text);
    }
    let text = format!(
        "the motion repeats that of {name} (the angles differ by {} % of it): as a test of the other, either log shows \
         how well torques repeat, and nothing about other motions",
        short(100.0 * repeated.share)
    );
    Finding::new(Severity::Warning, text)
}

/// Mean square of a log's angles about their means, of all joints together.
fn motion(log: &Log) -> f64 {
    let of_joint = |q: &Vec<f64>| deviation(q).powi(2);
    log.q.iter().map(of_joint).sum()
}

/// Difference of the angles of two logs, each in the time since its start, as a share of the motion of the first, whose
/// mean square is `moves`. `None` if it is not a repetition: they differ by more, in joints or in length, or nothing
/// moves.
fn difference(a: &Log, moves: f64, b: &Log) -> Option<f64> {
    let (shorter, longer) = (
        a.duration().min(b.duration()),
        a.duration().max(b.duration()),
    );
    if a.joints() != b.joints() || a.rows() < 2 || b.rows() < 2 || shorter < WHOLE * longer {
        return None;
    }
    let since_start = |time: &f64| time - a.time[0];
    let common = a.time.partition_point(|time| since_start(time) <= shorter);
    let most = SAME.powi(2) * moves * common as f64;
    let mut differs = 0.0;
    for (a_q, b_q) in a.q.iter().zip(&b.q) {
        let times = a.time[..common]
            .iter()
            .map(|time| b.time[0] + since_start(time));
        for (a, b) in a_q.iter().zip(resampled(times, &b.time, b_q)) {
            differs += (a - b).powi(2);
            // Most pairs of logs already differ in their first rows.
            if differs >= most {
                return None;
            }
        }
    }
    Some(SAME * (differs / most).sqrt())
}

#[cfg(test)]
mod tests {
    use super::super::tests::{each, two_sines};
    use super::{Repeated, report_repeats};
    use crate::data::{Audit, Columns, Log, audit};

    /// Two joints on sines of this frequency, from this time on.
    fn log(name: &str, start: f64, frequency: f64, off: f64) -> Log {
        let mut log = two_sines(name, 800, [1.0, 0.3], frequency);
        for q in &mut log.q {
            each(q, |row, q| q + off * (0.09 * row as f64).sin());
        }
        each(&mut log.time, |_, t| start + t);
        log
    }

    #[test]
    fn the_same_motion_once_more_is_reported_with_the_log_that_it_repeats() {
        let logs = [
            log("a.csv", 0.0, 2.0, 0.0),
            log("b.csv", 5.0, 2.0, 0.004),
            log("c.csv", 0.0, 2.3, 0.0),
            log("d.csv", 0.0, 2.0, 0.1),
            log("e.csv", 7.0, 2.3, 0.0),
            log("f.csv", 9.0, 2.0, 0.004),
        ];
        let audit = |log| audit(log, &Columns::default());
        let mut audits: Vec<Audit> = logs.iter().map(audit).collect();
        let repeated = report_repeats(&logs, &mut audits);
        let message = |words: &str| -> Vec<bool> {
            let says = |audit: &Audit| audit.findings.iter().any(|f| f.text.contains(words));
            audits.iter().map(says).collect()
        };
        let repeats = message("the motion repeats that of a.csv");
        assert_eq!(repeats, [false, true, false, false, false, false]);
        let is_same = message("every angle equals that of c.csv");
        assert_eq!(is_same, [false, false, false, false, true, false]);
        // If one log moves alike and another is identical, the latter is named.
        let is_same = message("every angle equals that of b.csv");
        assert_eq!(is_same, [false, false, false, false, false, true]);
        let place = |of: Repeated| (of.place, of.is_identical());
        let places = repeated.into_iter().map(|repeated| repeated.map(place));
        let found = [
            None,
            Some((0, false)),
            None,
            None,
            Some((2, true)),
            Some((1, true)),
        ];
        assert_eq!(places.collect::<Vec<_>>(), found);
    }
}
