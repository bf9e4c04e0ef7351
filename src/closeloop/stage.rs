/// A stage of closing the loop, in the order of `docs/method.md`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
}

impl<'t> Progress<'t> {
    /// A step within a stage.
    pub(super) fn within(stage: Stage, text: &'t str) -> Self {
        Self { stage, text }
    }
}

impl From<Stage> for Progress<'_> {
    fn from(stage: Stage) -> Self {
        Self::within(stage, stage.text())
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
