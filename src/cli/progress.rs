//! Progress of long work, on standard error: a bar on a terminal, otherwise a line every ten seconds.

use std::ops::Deref;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Result;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::{interrupt, terminal};
use residyn_core::closeloop::{Fits, Progress, Stage, StageTimes, Watch};
use residyn_io::runs::RunFolder;

/// How often a line is written if there is no terminal.
const EVERY: Duration = Duration::from_secs(10);

/// A progress bar, replaced by lines where it cannot be seen.
pub(super) struct Bar {
    bar: ProgressBar,
    /// Ends the lines when it is dropped.
    _lines: Option<Sender<()>>,
}

impl Deref for Bar {
    type Target = ProgressBar;

    fn deref(&self) -> &ProgressBar {
        &self.bar
    }
}

/// The progress of `steps` steps that take about equally long.
pub(super) fn bar(steps: usize) -> Bar {
    shown(steps, step_line)
}

/// The progress of the stages of closing the loop, which take very different times.
pub(super) fn stages() -> Bar {
    shown(Stage::ALL.len(), stage_line)
}

fn shown(steps: usize, line: fn(&ProgressBar) -> String) -> Bar {
    let bar = ProgressBar::new(steps as u64);
    if terminal::is_quiet() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style =
        ProgressStyle::with_template("{spinner} [{bar:24}] {pos}/{len} ({elapsed}) {wide_msg}")
            .expect("the template is sound")
            .progress_chars("=> ");
    bar.set_style(style);
    let lines = bar.is_hidden().then(|| lines(bar.clone(), line));
    if lines.is_none() {
        bar.enable_steady_tick(Duration::from_millis(120));
    }
    Bar { bar, _lines: lines }
}

/// Write a line from time to time, until what is returned is dropped.
fn lines(bar: ProgressBar, line: fn(&ProgressBar) -> String) -> Sender<()> {
    let (sender, ended) = mpsc::channel();
    thread::spawn(move || {
        while ended.recv_timeout(EVERY) == Err(RecvTimeoutError::Timeout) {
            terminal::say(line(&bar));
        }
    });
    sender
}

/// `34 %: 3400 of 10000 epochs, loss 1.2e-3; about 25 s left`
#[allow(clippy::cast_precision_loss)] // counts are far fewer than 2^52
fn step_line(bar: &ProgressBar) -> String {
    let (done, of) = (bar.position(), bar.length().unwrap_or(0));
    let percent = 100 * done / of.max(1);
    // The bar's own estimate grows without bound while one long step is not done.
    let each_s = bar.elapsed().as_secs_f64() / done as f64;
    let left = match each_s * of.saturating_sub(done) as f64 {
        left if left >= 1.0 && left.is_finite() => format!("; about {left:.0} s left"),
        _ => String::new(),
    };
    format!("{percent} %: {done} of {of} {}{left}", bar.message())
}

/// `stage 4 of 9: selecting effects, 12 of 40, about 30 s left`
fn stage_line(bar: &ProgressBar) -> String {
    let of = bar.length().unwrap_or(0);
    format!("stage {} of {of}: {}", bar.position() + 1, bar.message())
}

/// Shows the stages of closing the loop: how long the models that are being fitted will still take and, in a verbose run, how
/// long each stage took. Ends the search when its time is spent.
pub(super) struct Stages {
    bar: Bar,
    /// `None` if the search may take longer than a clock counts.
    deadline: Option<Instant>,
    start: Instant,
    seen: Mutex<Seen>,
}

struct Seen {
    times: StageTimes,
    fits_since: Instant,
}

impl Stages {
    /// A search may take as long as `budget` from now on.
    pub fn new(budget: Duration) -> Self {
        let start = Instant::now();
        Self {
            bar: stages(),
            deadline: start.checked_add(budget),
            start,
            seen: Mutex::new(Seen {
                times: StageTimes::default(),
                fits_since: start,
            }),
        }
    }

    /// Say something while the bar is out of the way.
    pub fn beside(&self, say: impl FnOnce()) {
        self.bar.suspend(say);
    }

    /// The last stage is done; how long each took, in s.
    pub fn finish(self) -> Vec<(Stage, f64)> {
        let Seen { times, .. } = self
            .seen
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let (last, begun) = times.now();
        self.bar
            .suspend(|| terminal::took(last.text(), self.start + begun));
        self.bar.finish_and_clear();
        times.end(self.start.elapsed())
    }
}

impl Watch for Stages {
    fn see(&self, now: Progress<'_>) {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((ended, begun)) = seen.times.note(now.stage, self.start.elapsed()) {
            self.bar
                .suspend(|| terminal::took(ended.text(), self.start + begun));
        }
        self.bar.set_position(now.stage.number() as u64);
        self.bar.set_message(seen.message(now));
    }

    fn has_to_end(&self) -> bool {
        self.deadline
            .is_some_and(|deadline| Instant::now() >= deadline)
    }
}

impl Seen {
    /// What is being done and, if it is fitting a number of models, about how long it will still take.
    fn message(&mut self, now: Progress<'_>) -> String {
        match now.fits {
            Some(Fits { done, of }) if done > 0 => {
                let each_s = self.fits_since.elapsed().as_secs_f64() / done as f64;
                let left_s = each_s * (of - done) as f64;
                format!("{}, {done} of {of}, about {left_s:.0} s left", now.text)
            }
            _ => {
                self.fits_since = Instant::now();
                now.text.to_owned()
            }
        }
    }
}

/// Do all pieces of work, `what` in the plural, whose results `folder` keeps, with a bar.
pub(super) fn each<P, R>(
    folder: &RunFolder,
    what: &'static str,
    pieces: &[P],
    mut work: impl FnMut(&P, &ProgressBar) -> Result<R>,
) -> Result<Vec<R>> {
    let bar = bar(pieces.len());
    let _orderly = interrupt::counted(folder, &bar, what);
    let done = pieces.iter().map(|piece| {
        let result = work(piece, &bar)?;
        bar.inc(1);
        Ok(result)
    });
    let done = done.collect();
    bar.finish_and_clear();
    done
}

/// Shows on a bar what is done in one of its steps.
pub(super) struct Step<'b> {
    pub bar: &'b ProgressBar,
    /// The step, in a few words.
    pub what: String,
}

impl Watch for Step<'_> {
    fn see(&self, now: Progress<'_>) {
        self.bar.set_message(format!("{}: {}", self.what, now.text));
    }
}

#[cfg(test)]
mod tests {
    use super::{bar, stage_line, stages, step_line};

    #[test]
    fn a_line_says_what_is_done_and_how_much_of_it() {
        let epochs = bar(10_000);
        epochs.set_position(3400);
        epochs.set_message("epochs, loss 1.2e-3");
        let line = step_line(&epochs);
        let share = "34 %: 3400 of 10000 epochs, loss 1.2e-3";
        assert!(line.starts_with(share), "{line}");
        // An unknown number of steps does not divide by zero.
        assert!(step_line(&bar(0)).starts_with("0 %: 0 of 0"));
        let stages = stages();
        stages.set_position(3);
        stages.set_message("selecting effects");
        assert!(stage_line(&stages).starts_with("stage 4 of "));
        assert!(stage_line(&stages).ends_with(": selecting effects"));
    }
}
