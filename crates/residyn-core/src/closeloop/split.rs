//! Stage 1: set apart the logs that models are scored on.

use std::cmp::Ordering;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::settings::SplitSettings;
use crate::data::{Log, row_after, row_from};

/// The logs that a problem learns from and those that it is judged by.
#[derive(Debug, Clone)]
pub struct Split {
    pub train: Vec<Log>,
    pub test: Vec<Log>,
    pub method: SplitMethod,
}

/// How the test logs were set apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SplitMethod {
    /// The user named them.
    Given,
    /// The last of the given logs.
    LastLogs { count: usize },
    /// The end of every log, after a gap: the largest share of a log, including the gap.
    EndOfEachLog { share: f64, gap_s: f64 },
}

impl Split {
    /// The split that the user asks for.
    pub fn given(train: Vec<Log>, test: Vec<Log>) -> Self {
        Self {
            train,
            test,
            method: SplitMethod::Given,
        }
    }

    /// The same with the logs sorted by name and, if names are equal, by content: sums and random draws take the logs
    /// one after the other, and the result must not depend on the order in which they were given.
    pub(super) fn in_order(mut self) -> Self {
        self.train.sort_by(by_name);
        self.test.sort_by(by_name);
        self
    }

    /// Set whole trajectories apart if there are three or more, else the end of each.
    pub fn of(mut logs: Vec<Log>, settings: &SplitSettings) -> Self {
        if logs.len() >= settings.whole_logs_from {
            let count = settings.count_of(logs.len());
            let test = logs.split_off(logs.len() - count);
            return Self {
                train: logs,
                test,
                method: SplitMethod::LastLogs { count },
            };
        }
        Self::ends_of(logs, settings)
    }

    /// Set the end of each log apart.
    fn ends_of(logs: Vec<Log>, settings: &SplitSettings) -> Self {
        let (mut train, mut test) = (Vec::new(), Vec::new());
        let mut share = settings.test_share;
        for log in logs {
            let rest_s = settings.rest_s(log.duration());
            share = share.max(rest_s / log.duration());
            let middle = log.time[log.rows() - 1] - rest_s;
            train.push(between(&log, f64::NEG_INFINITY, middle));
            test.push(between(&log, middle + settings.gap_s, f64::INFINITY));
        }
        // A log too short to divide gives no test log.
        test.retain(|log| log.rows() > 1);
        Self {
            train,
            test,
            method: SplitMethod::EndOfEachLog {
                share,
                gap_s: settings.gap_s,
            },
        }
    }
}

impl SplitSettings {
    /// Length of the end of a log that goes into the gap and the test, in s: a larger share of a short log, so that it
    /// can be judged.
    fn rest_s(&self, duration_s: f64) -> f64 {
        let enough = (self.test_share * duration_s).max(self.gap_s + self.shortest_test_s);
        enough.min(self.largest_share * duration_s)
    }

    /// How many of `logs` logs are set apart.
    fn count_of(&self, logs: usize) -> usize {
        ((logs as f64 * self.test_share).round() as usize).max(1)
    }
}

fn by_name(a: &Log, b: &Log) -> Ordering {
    let by_numbers = || by_numbers(a.q.iter().flatten(), b.q.iter().flatten());
    a.path.cmp(&b.path).then_with(by_numbers)
}

/// The order of two channels of finite numbers by the first numbers that differ.
pub(super) fn by_numbers<'a>(
    a: impl Iterator<Item = &'a f64>,
    b: impl Iterator<Item = &'a f64>,
) -> Ordering {
    a.partial_cmp(b).unwrap_or(Ordering::Equal)
}

/// The rows of a log from `start_s` to `end_s`.
pub fn between(log: &Log, start_s: f64, end_s: f64) -> Log {
    let rows = row_from(&log.time, start_s)..row_after(&log.time, end_s);
    log.at(std::slice::from_ref(&rows))
}
