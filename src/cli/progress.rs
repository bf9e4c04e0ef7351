use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::closeloop::{Fits, Progress};

/// A progress bar of `steps` steps on standard error, hidden where that is no terminal.
pub(super) fn bar(steps: usize) -> ProgressBar {
    let bar = ProgressBar::new(steps as u64);
    let style = ProgressStyle::with_template("{spinner} [{bar:24}] {pos}/{len} {msg} ({elapsed})")
        .expect("the template is sound")
        .progress_chars("=> ");
    bar.set_style(style);
    bar.enable_steady_tick(Duration::from_millis(120));
    bar
}

/// Estimates how long models that are being fitted will still take.
pub(super) struct Estimate {
    since: Instant,
}

impl Estimate {
    pub fn new() -> Self {
        Self {
            since: Instant::now(),
        }
    }

    /// What is being done and, where that is a number of models to fit, about how long it will still take.
    pub fn message(&mut self, now: &Progress<'_>) -> String {
        match now.fits {
            Some(Fits { done, of }) if done > 0 => {
                let each_s = self.since.elapsed().as_secs_f64() / done as f64;
                let left_s = each_s * (of - done) as f64;
                format!("{}, {done} of {of}, about {left_s:.0} s left", now.text)
            }
            _ => {
                self.since = Instant::now();
                now.text.to_owned()
            }
        }
    }
}
