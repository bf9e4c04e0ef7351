use std::time::Duration;

use serde::Serialize;

/// A stage of closing the loop, in the order of `docs/method.md`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Stage {
    Audit,
    Fit,
    Select,
    Establish,
    Diagnostics,
    Discriminate,
    Refine,
    Learn,
    Score,
}

impl Stage {
    /// In the order in which [`close_loop`](super::close_loop) goes through them.
    pub const ALL: [Self; 9] = [
        Self::Audit,
        Self::Fit,
        Self::Select,
        Self::Establish,
        Self::Diagnostics,
        Self::Discriminate,
        Self::Refine,
        Self::Learn,
        Self::Score,
    ];

    /// Number of stages that come before this one.
    pub fn number(self) -> usize {
        self as usize
    }

    /// What is being done, for a progress display.
    pub fn text(self) -> &'static str {
        match self {
            Self::Audit => "auditing the logs",
            Self::Fit => "fitting the declared model",
            Self::Select => "selecting effects",
            Self::Establish => "judging each effect",
            Self::Diagnostics => "testing the residuals",
            Self::Discriminate => "simulating experiments",
            Self::Refine => "estimating in fine steps",
            Self::Learn => "training the residual network",
            Self::Score => "scoring on the test logs",
        }
    }
}

/// What is being done now, for a progress display.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Progress<'t> {
    pub stage: Stage,
    pub text: &'t str,
    /// How much of it is done, if it is a number of models to fit.
    pub fits: Option<Fits>,
}

/// How many of the models are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fits {
    pub done: usize,
    pub of: usize,
}

/// Follows the work, from any of the threads that do it, and may end the search.
///
/// The library reads no clock: whoever bounds the time of a search, or times its stages, does so here.
pub trait Watch: Sync {
    /// Receives what is being done.
    fn see(&self, now: Progress<'_>);

    /// Whether the search for effects is to end now. Asked before each fit.
    fn has_to_end(&self) -> bool {
        false
    }
}

/// Nobody watches, and the search runs to its end.
impl Watch for () {
    fn see(&self, _: Progress<'_>) {}
}

impl<'t> Progress<'t> {
    /// A step within a stage.
    pub(super) fn within(stage: Stage, text: &'t str) -> Self {
        let fits = None;
        Self { stage, text, fits }
    }
}

impl From<Stage> for Progress<'_> {
    fn from(stage: Stage) -> Self {
        Self::within(stage, stage.text())
    }
}

/// How long each stage took, by the watcher's clock: times count from its start.
#[derive(Debug)]
pub struct StageTimes {
    now: (Stage, Duration),
    past: Vec<(Stage, f64)>,
}

impl Default for StageTimes {
    /// The first stage begins.
    fn default() -> Self {
        Self {
            now: (Stage::ALL[0], Duration::ZERO),
            past: Vec::new(),
        }
    }
}

impl StageTimes {
    /// A stage continues or begins; returns the stage that thereby ended, and when that began.
    pub fn note(&mut self, stage: Stage, at: Duration) -> Option<(Stage, Duration)> {
        if stage == self.now.0 {
            return None;
        }
        self.past.push(self.until(at));
        Some(std::mem::replace(&mut self.now, (stage, at)))
    }

    /// The current stage, and when it began.
    pub fn now(&self) -> (Stage, Duration) {
        self.now
    }

    /// Time of each stage in s, in order; the last one ends here.
    pub fn end(mut self, at: Duration) -> Vec<(Stage, f64)> {
        self.past.push(self.until(at));
        self.past
    }

    fn until(&self, at: Duration) -> (Stage, f64) {
        let (stage, since) = self.now;
        (stage, at.saturating_sub(since).as_secs_f64())
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{Stage, StageTimes};

    #[test]
    fn a_stage_lasts_until_the_next_one_begins() {
        let at = Duration::from_secs;
        let mut times = StageTimes::default();
        assert!(times.note(Stage::Audit, at(1)).is_none());
        assert_eq!(times.note(Stage::Fit, at(3)), Some((Stage::Audit, at(0))));
        assert_eq!(times.end(at(7)), [(Stage::Audit, 3.0), (Stage::Fit, 4.0)]);
    }

    #[test]
    fn stages_are_numbered_in_their_order() {
        for (number, stage) in Stage::ALL.into_iter().enumerate() {
            assert_eq!(stage.number(), number);
        }
    }
}
