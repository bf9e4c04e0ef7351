use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

use crate::Progress;

/// When a run is saved: after so many epochs, at its end, and before an interruption would lose more than ten seconds of work.
#[derive(Debug)]
pub struct Saves {
    every: NonZeroUsize,
    last: Instant,
}

/// The most work that an interruption can lose.
const LONGEST_UNSAVED: Duration = Duration::from_secs(10);

impl Saves {
    /// The epochs between two checkpoints, unless told otherwise.
    pub const EVERY: NonZeroUsize = NonZeroUsize::new(500).expect("not zero");

    /// For a run that begins or goes on now.
    pub fn new(every: NonZeroUsize) -> Self {
        let last = Instant::now();
        Self { every, last }
    }

    /// Whether the run is to be saved now; if so, the caller does.
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
