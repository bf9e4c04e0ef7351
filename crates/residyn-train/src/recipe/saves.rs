use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

use crate::Progress;

/// When a run is saved: every set number of epochs, at its end, and before an interruption would lose more than ten
/// seconds of work.
#[derive(Debug)]
pub struct Saves {
    every: NonZeroUsize,
    last: Instant,
}

/// The most work that an interruption can lose.
const LONGEST_UNSAVED: Duration = Duration::from_secs(10);

impl Saves {
    /// The default number of epochs between two checkpoints.
    pub const EVERY: NonZeroUsize = NonZeroUsize::new(500).expect("not zero");

    /// For a run that begins or continues now.
    pub fn new(every: NonZeroUsize) -> Self {
        let last = Instant::now();
        Self { every, last }
    }

    /// Whether the run is due for saving; if so, the caller saves it.
    pub fn are_due(&mut self, at: &Progress<'_>) -> bool {
        let due = at.epoch.is_multiple_of(self.every.get())
            || at.epoch == at.epochs
            || self.last.elapsed() >= LONGEST_UNSAVED;
        if due {
            self.last = Instant::now();
        }
        due
    }
}
