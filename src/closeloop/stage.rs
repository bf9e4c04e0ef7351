use std::time::Instant;

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
    Remainder,
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
        Self::Remainder,
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
            Self::Remainder => "testing the residuals",
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
    /// How much of it is done, where it is a number of models to fit.
    pub fits: Option<Fits>,
}

/// Models of which some are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fits {
    pub done: usize,
    pub of: usize,
}

/// Receives progress, from any of the threads that fit models.
pub type Observer<'o> = dyn FnMut(Progress<'_>) + Send + 'o;

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

/// Takes the time of each stage.
pub(super) struct Clock {
    now: (Stage, Instant),
    past: Vec<(Stage, f64)>,
}

impl Clock {
    /// Starts with the first stage.
    pub fn start() -> Self {
        Self {
            now: (Stage::ALL[0], Instant::now()),
            past: Vec::new(),
        }
    }

    /// A stage goes on or begins.
    pub fn note(&mut self, stage: Stage) {
        if stage != self.now.0 {
            self.past.push(self.ended());
            self.now = (stage, Instant::now());
        }
    }

    /// Time in s of each stage, in their order.
    pub fn stop(mut self) -> Vec<(Stage, f64)> {
        self.past.push(self.ended());
        self.past
    }

    fn ended(&self) -> (Stage, f64) {
        (self.now.0, self.now.1.elapsed().as_secs_f64())
    }
}

#[cfg(test)]
mod tests {
    use super::Stage;

    #[test]
    fn stages_are_numbered_in_their_order() {
        for (number, stage) in Stage::ALL.into_iter().enumerate() {
            assert_eq!(stage.number(), number);
        }
    }
}
