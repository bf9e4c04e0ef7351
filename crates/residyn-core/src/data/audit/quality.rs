//! The quality of one log, in numbers and in sentences.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::joint::JointAudit;
use crate::data::Joint;
use crate::data::column::Quantity;
use crate::data::log::Interval;
use crate::data::of_joints;

/// Longer lists of intervals than these are not practical to paste, or to read.
const MOST_SPANS: usize = 20;
const TOLD_SPANS: usize = 3;

/// The quality of one log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Audit {
    /// The log's file name.
    pub log: String,
    /// Number of rows.
    pub rows: usize,
    /// Rows that show what channels look like and how joints move: all, or, for a long log, enough of them to show the
    /// same, in intervals that are spread evenly over it.
    pub examined_rows: usize,
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
    /// Rows that are missing in steps of two to five median steps.
    pub dropped_rows: usize,
    /// What drives the joints: torques or commands.
    pub driven_by: Quantity,
    /// One entry per joint.
    pub joints: Vec<JointAudit>,
    /// The earlier log whose motion it repeats, among those that it was compared with.
    pub repeats: Option<String>,
    /// What an engineer should know before fitting, the most serious first.
    pub findings: Vec<Finding>,
}

impl Audit {
    /// What concerns these joints, without the findings.
    #[must_use]
    pub(crate) fn of_joints(&self, joints: &[Joint]) -> Self {
        Self {
            joints: of_joints(&self.joints, joints),
            findings: Vec::new(),
            ..self.clone()
        }
    }

    /// Add what was found later, in its place.
    pub(crate) fn add(&mut self, finding: Finding) {
        self.findings.push(finding);
        self.findings.sort_by_key(|finding| finding.severity);
    }

    /// The findings that make results wrong unless something is done.
    pub fn serious(&self) -> impl Iterator<Item = &Finding> {
        let findings = self.findings.iter();
        findings.filter(|finding| finding.severity == Severity::Serious)
    }
}

/// How much a finding matters.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Results will be wrong, or cannot be obtained from this log, unless something is done.
    Serious,
    /// Results will be poorer, or some effects cannot be distinguished.
    Warning,
    /// Good to know.
    Info,
}

/// One plain sentence about a log, with its evidence, its place and its remedy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// The joint that it concerns, if it is a single one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<Joint>,
    /// Where it is in the log: start and end of each interval in s, the longest ones if there are many. Empty if it
    /// concerns the whole log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub spans_s: Vec<[f64; 2]>,
    /// The sentence.
    pub text: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<Remedy>,
}

/// What to paste to fix a finding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Remedy {
    /// Intervals to leave out, each as `LOG@T0-T1`.
    LeaveOut(Vec<String>),
    /// Lines of the model file, in the table `[columns]`.
    Columns(Vec<String>),
}

impl Finding {
    /// A finding about a whole log.
    pub(crate) fn new(severity: Severity, text: impl Into<String>) -> Self {
        Self {
            severity,
            joint: None,
            spans_s: vec![],
            text: text.into(),
            remedy: None,
        }
    }

    /// The same finding about one joint.
    pub(crate) fn of(self, joint: Joint) -> Self {
        Self {
            joint: Some(joint),
            ..self
        }
    }

    /// The same finding in these intervals of a log, which can be left out if they are few.
    pub(crate) fn within(self, log: &str, spans: &[Interval]) -> Self {
        let argument = |span: &Interval| format!("{log}@{}-{}", span.start_s, span.end_s);
        let few = spans.len() <= MOST_SPANS;
        Self {
            remedy: few.then(|| Remedy::LeaveOut(spans.iter().map(argument).collect())),
            ..self.during(spans)
        }
    }

    /// The same finding in these intervals of a log.
    pub(super) fn during(self, spans: &[Interval]) -> Self {
        Self {
            spans_s: longest(spans.iter().map(ends).collect(), MOST_SPANS),
            ..self
        }
    }

    /// The sentence, and in brackets its remedy, in the words of the caller, or else its place.
    pub fn message(&self, words: RemedyWords<'_>) -> String {
        let more = self.remedy.as_ref().map(words);
        match more.or_else(|| self.place()) {
            Some(more) => format!("{} ({more})", self.text),
            None => self.text.clone(),
        }
    }

    /// Where it is in the log, `t = 2 to 3.2 s, 5 to 6 s and shorter ones`; `None` if it concerns the whole log.
    pub(super) fn place(&self) -> Option<String> {
        let message = longest(self.spans_s.clone(), TOLD_SPANS);
        let span = |[start, end]: &[f64; 2]| format!("{} to {} s", seconds(*start), seconds(*end));
        let text = message.iter().map(span).collect::<Vec<_>>().join(", ");
        let more = match self.spans_s.len() > message.len() {
            true => " and shorter ones",
            false => "",
        };
        (!message.is_empty()).then(|| format!("t = {text}{more}"))
    }
}

fn ends(span: &Interval) -> [f64; 2] {
    [span.start_s, span.end_s]
}

/// How the program that shows a finding words its remedy.
pub(crate) type RemedyWords<'w> = &'w dyn Fn(&Remedy) -> String;

/// The longest of some intervals, in the order of time.
fn longest(mut spans: Vec<[f64; 2]>, most: usize) -> Vec<[f64; 2]> {
    spans.sort_by(|a, b| (b[1] - b[0]).total_cmp(&(a[1] - a[0])));
    spans.truncate(most);
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    spans
}

/// A time to the millisecond.
fn seconds(time_s: f64) -> f64 {
    (1e3 * time_s).round() / 1e3
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message(&Remedy::to_string))
    }
}

impl fmt::Display for Remedy {
    /// `leave out run1.csv@4.2-5`, or `[columns] time = { column = "time", unit = "ms" }`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LeaveOut(spans) => write!(f, "leave out {}", spans.join(" ")),
            Self::Columns(lines) => write!(f, "[columns] {}", lines.join("; ")),
        }
    }
}
