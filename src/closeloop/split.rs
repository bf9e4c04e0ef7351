use serde::Serialize;

use crate::data::Log;

/// Which logs a study learns from and which it is judged by.
#[derive(Debug, Clone)]
pub struct Split {
    pub train: Vec<Log>,
    pub test: Vec<Log>,
    pub how: How,
}

/// How the test logs were set apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum How {
    /// The user named them.
    Given,
    /// The last logs of those given.
    LastLogs { count: usize },
    /// The end of every log, after a gap.
    EndOfEachLog { share: f64, gap_s: f64 },
}

/// Share of the logs, or of each log, that is kept for the test.
const TEST_SHARE: f64 = 0.25;
/// With this many logs whole ones are kept for the test.
const ENOUGH_LOGS: usize = 3;
/// Time between what is learned from and what is judged by, when both come from one log.
const GAP_S: f64 = 0.5;

impl Split {
    /// The split that the user asks for.
    pub fn given(train: Vec<Log>, test: Vec<Log>) -> Self {
        Self {
            train,
            test,
            how: How::Given,
        }
    }

    /// Set whole trajectories apart where there are three or more, else the end of each.
    pub fn of(mut logs: Vec<Log>) -> Self {
        if logs.len() >= ENOUGH_LOGS {
            #[allow(
                clippy::cast_precision_loss,
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss
            )]
            let count = ((logs.len() as f64 * TEST_SHARE).round() as usize).max(1);
            let test = logs.split_off(logs.len() - count);
            return Self {
                train: logs,
                test,
                how: How::LastLogs { count },
            };
        }
        let (mut train, mut test) = (Vec::new(), Vec::new());
        for log in logs {
            let middle = log.time[0] + (1.0 - TEST_SHARE) * log.duration();
            train.push(between(&log, f64::NEG_INFINITY, middle));
            test.push(between(&log, middle + GAP_S, f64::INFINITY));
        }
        // A log too short for a rest gives no test.
        test.retain(|log| log.rows() > 1);
        Self {
            train,
            test,
            how: How::EndOfEachLog {
                share: TEST_SHARE,
                gap_s: GAP_S,
            },
        }
    }
}

/// The rows of a log from `start_s` to `end_s`.
fn between(log: &Log, start_s: f64, end_s: f64) -> Log {
    let rows =
        log.time.partition_point(|t| *t < start_s)..log.time.partition_point(|t| *t <= end_s);
    let cut = |columns: &[Vec<f64>]| columns.iter().map(|c| c[rows.clone()].to_vec()).collect();
    Log {
        path: log.path.clone(),
        time: log.time[rows.clone()].to_vec(),
        q: cut(&log.q),
        qd: cut(&log.qd),
        tau: cut(&log.tau),
        leave_out: log.leave_out.clone(),
        notes: log.notes.clone(),
    }
}
