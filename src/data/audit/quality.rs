//! The quality of one log, in numbers and in sentences.

use schemars::JsonSchema;
use serde::Serialize;

use super::joint::JointAudit;
use crate::data::log::Interval;

/// The quality of one log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Audit {
    /// The log's file name.
    pub log: String,
    /// Number of rows.
    pub rows: usize,
    /// Time from the first to the last row \[s\].
    pub duration_s: f64,
    /// Median time between neighbouring rows \[s\].
    pub median_step_s: f64,
    /// Shortest time between neighbouring rows \[s\].
    pub min_step_s: f64,
    /// Longest time between neighbouring rows \[s\].
    pub max_step_s: f64,
    /// Standard deviation of the steps over the median step, gaps not counted.
    pub jitter: f64,
    /// Steps longer than five median steps.
    pub gaps: Vec<Interval>,
    /// One entry a joint.
    pub joints: Vec<JointAudit>,
    /// What an engineer should know before fitting, the most serious first.
    pub findings: Vec<Finding>,
}

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Results will be wrong or cannot be had from this log unless something is done.
    Serious,
    /// Results will be poorer, or some effects cannot be told apart.
    Warning,
    /// Good to know.
    Info,
}

/// One plain sentence about a log, with its evidence and, where there is one, its remedy.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// The sentence.
    pub text: String,
}
