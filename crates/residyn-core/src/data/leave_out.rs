//! Intervals of logs that are neither fitted nor scored, as given on a command line.

use std::path::{Component, Path};
use std::str::FromStr;

use thiserror::Error;

use super::log::{Interval, Log};

/// One interval of one log to leave out, written `LOG@t0-t1` with both times in s.
#[derive(Debug, Clone, PartialEq)]
pub struct LeaveOut {
    /// The log, by its path or its file name.
    pub log: String,
    /// The interval, on the log's own time axis.
    pub interval: Interval,
}

/// Why an interval to leave out could not be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum LeaveOutError {
    /// The text is not of the form `LOG@t0-t1`.
    #[error(
        "{text:?} is not an interval of a log; write LOG@START-END in seconds, such as rig.csv@15.8-16.4"
    )]
    Syntax {
        /// The text as given.
        text: String,
    },
    /// The interval is negative, empty or backwards.
    #[error("{text:?}: an interval starts at 0 s or later and ends after it starts")]
    Backwards {
        /// The text as given.
        text: String,
    },
    /// No log has this path or file name.
    #[error("no log is called {log:?}; the logs are {logs}")]
    Unknown {
        /// The log as given.
        log: String,
        /// The logs there are.
        logs: String,
    },
    /// Several logs in different folders have this file name.
    #[error("{log:?} could be any of {logs}; give its path")]
    Ambiguous {
        /// The log as given.
        log: String,
        /// The logs of that name.
        logs: String,
    },
}

impl FromStr for LeaveOut {
    type Err = LeaveOutError;

    fn from_str(text: &str) -> Result<Self, LeaveOutError> {
        let given = || text.to_owned();
        let syntax = || LeaveOutError::Syntax { text: given() };
        // The last `@`, since file names may hold one and times do not.
        let (log, times) = text.rsplit_once('@').ok_or_else(syntax)?;
        let interval = parse_interval(times).ok_or_else(syntax)?;
        if log.is_empty() {
            return Err(syntax());
        }
        if interval.start_s < 0.0 || interval.length_s() <= 0.0 {
            return Err(LeaveOutError::Backwards { text: given() });
        }
        let log = log.to_owned();
        Ok(LeaveOut { log, interval })
    }
}

/// The two numbers on either side of a dash. A dash may also be a sign or belong to an exponent
/// (`1e-3-2e-1`), so the dash meant is the one with a number on either side.
fn parse_interval(text: &str) -> Option<Interval> {
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|t| t.is_finite());
    text.match_indices('-').find_map(|(dash, _)| {
        Some(Interval {
            start_s: number(&text[..dash])?,
            end_s: number(&text[dash + 1..])?,
        })
    })
}

/// Adds each interval to the log that it names.
///
/// A log is identified by its path as given or, if that is unique, by its file name. An interval that lies outside its
/// log changes nothing and is reported in the log's notes.
///
/// # Errors
/// [`LeaveOutError::Unknown`] for an entry that matches no log, [`LeaveOutError::Ambiguous`] for one
/// that matches several. The logs are then unchanged.
pub fn apply(logs: &mut [Log], entries: &[LeaveOut]) -> Result<(), LeaveOutError> {
    let places = entries.iter().map(|entry| place(logs, &entry.log));
    let places: Vec<usize> = places.collect::<Result<_, _>>()?;
    for (place, entry) in places.into_iter().zip(entries) {
        let log = &mut logs[place];
        log.leave_out.push(entry.interval);
        if !overlaps(log, entry.interval) {
            let note = format!("left-out interval {} lies outside the log", entry.interval);
            log.notes.push(note);
        }
    }
    Ok(())
}

fn overlaps(log: &Log, interval: Interval) -> bool {
    let is_inside = |t: &f64| (interval.start_s..=interval.end_s).contains(t);
    log.time.iter().any(is_inside)
}

/// Index of the log that is called `name`.
fn place(logs: &[Log], name: &str) -> Result<usize, LeaveOutError> {
    let by_path = |log: &Log| same_path(&log.path, Path::new(name));
    if let Some(place) = logs.iter().position(by_path) {
        return Ok(place);
    }
    let all: Vec<usize> = (0..logs.len()).collect();
    let called = all.iter().copied().filter(|at| logs[*at].name() == name);
    let list = |places: &[usize]| {
        let paths = places.iter().map(|at| logs[*at].path.display().to_string());
        paths.collect::<Vec<_>>().join(", ")
    };
    let log = name.to_owned();
    match &*called.collect::<Vec<usize>>() {
        [place] => Ok(*place),
        [] => Err(LeaveOutError::Unknown {
            log,
            logs: list(&all),
        }),
        several => Err(LeaveOutError::Ambiguous {
            log,
            logs: list(several),
        }),
    }
}

/// Whether two paths are the same text, apart from a leading `./`.
fn same_path(a: &Path, b: &Path) -> bool {
    let parts = |path| Path::components(path).filter(|part| *part != Component::CurDir);
    parts(a).eq(parts(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<(f64, f64), LeaveOutError> {
        let LeaveOut { interval, .. } = text.parse()?;
        Ok((interval.start_s, interval.end_s))
    }

    fn log(path: &str) -> Log {
        Log {
            path: path.into(),
            time: vec![0.0, 10.0, 20.0],
            ..Log::empty(0)
        }
    }

    #[test]
    fn times_may_be_whole_decimal_or_scientific() {
        assert_eq!(parse("rig.csv@15-16.4"), Ok((15.0, 16.4)));
        assert_eq!(parse("rig.csv@1e-3-2e-1"), Ok((1e-3, 2e-1)));
        assert_eq!(parse("a@b.csv@0-1E1"), Ok((0.0, 10.0)));
    }

    #[test]
    fn what_is_no_interval_is_an_error() {
        let text = |text: &str| text.to_owned();
        for no_interval in [
            "rig.csv", "r@", "r@1", "r@1e-3", "@1-2", "r@1-2-3", "r@0-inf",
        ] {
            let text = text(no_interval);
            assert_eq!(parse(no_interval), Err(LeaveOutError::Syntax { text }));
        }
        for backwards in ["r@2-1", "r@1-1", "r@-1-2", "r@1--2"] {
            let text = text(backwards);
            assert_eq!(parse(backwards), Err(LeaveOutError::Backwards { text }));
        }
    }

    #[test]
    fn a_log_is_found_by_path_or_by_unique_name() {
        let mut logs = [log("a/rig.csv"), log("b/rig.csv"), log("b/other.csv")];
        let entries = [
            "./b/rig.csv@1-12".parse().unwrap(),
            "other.csv@30-40".parse().unwrap(),
        ];
        apply(&mut logs, &entries).unwrap();
        let counts = logs.each_ref().map(|log| log.leave_out.len());
        assert_eq!(counts, [0, 1, 1]);
        assert_eq!(logs[1].notes.len(), 0);
        assert!(logs[2].notes[0].contains("30 to 40 s lies outside"));
    }

    #[test]
    fn unknown_and_ambiguous_logs_list_what_there_is() {
        let mut logs = [log("a/rig.csv"), log("b/rig.csv")];
        let unknown = apply(&mut logs, &["rug.csv@1-2".parse().unwrap()]).unwrap_err();
        assert_eq!(
            unknown.to_string(),
            "no log is called \"rug.csv\"; the logs are a/rig.csv, b/rig.csv"
        );
        let entries = [
            "a/rig.csv@1-2".parse().unwrap(),
            "rig.csv@1-2".parse().unwrap(),
        ];
        let ambiguous = apply(&mut logs, &entries).unwrap_err();
        assert!(matches!(ambiguous, LeaveOutError::Ambiguous { .. }));
        assert!(logs[0].leave_out.is_empty(), "nothing is applied by half");
    }
}
