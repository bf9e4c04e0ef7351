//! Shared by `train` and `tune`: run a job with a progress bar and checkpoints, and print the results.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, Result, anyhow};
use clap::Args;

use super::{Answer, Common, interrupt, progress, terminal};
use residyn_io::runs::RunFolder;
use residyn_train::recipe::{Change, Job, Saves};
use residyn_train::{Progress, Training, save};

/// Where and how often to save.
#[derive(Debug, Args)]
pub(super) struct Saving {
    /// Folder of the checkpoint; a run that was interrupted is resumed from its last checkpoint
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Epochs between checkpoints; one is also written after 10 s
    #[arg(long, default_value_t = Saves::EVERY, value_name = "EPOCHS")]
    save_every: NonZeroUsize,
}

impl Saving {
    /// The folder asked for, or one named after the `source` of the run.
    pub(super) fn folder(&self, source: &Path, ending: &str) -> PathBuf {
        let named = || {
            let stem = source.file_stem().unwrap_or_default();
            format!("{}-{ending}", stem.to_string_lossy()).into()
        };
        self.out.clone().unwrap_or_else(named)
    }
}

/// Runs a job to its end and prints the results.
pub(super) fn carry_out(job: &Job, dir: &Path, saving: &Saving, common: &Common) -> Result<Answer> {
    let folder = RunFolder::open(dir)?;
    for note in &job.data.notes {
        terminal::say(format!("note: {note}"));
    }
    let mut training = job.begin(&folder)?;
    if training.epoch() > 0 {
        terminal::say(format!(
            "note: {} resumes from epoch {}",
            dir.display(),
            training.epoch()
        ));
    }
    terminal::stage("training", || run(job, &mut training, &folder, saving))?;
    let results = job.results(&training, dir)?;
    let headline = format!("checkpoint: {}", dir.display());
    common.answer(|| &results, headline, &results.text())?;
    if results.is_worse() {
        let Change { before, after } = results.error;
        terminal::tell(format!(
            "warning: the training made the prediction error larger, from {before:.3e} to {after:.3e}; lower the learning rates"
        ));
        return Ok(Answer::No);
    }
    Ok(Answer::Yes)
}

fn run(job: &Job, training: &mut Training, folder: &RunFolder, saving: &Saving) -> Result<()> {
    let dir = folder.path();
    let bar = progress::bar(training.settings().epochs);
    let kept = Arc::new(AtomicUsize::new(training.epoch()));
    let of = training.settings().epochs;
    let says = kept_epochs(dir, &kept, of);
    let _orderly = interrupt::orderly(folder, says);
    let mut saves = Saves::new(saving.save_every);
    let mut failed = None;
    let mut observer = |at: &Progress| {
        bar.set_position(at.epoch as u64);
        bar.set_message(format!("epochs, loss {:.3e}", at.loss));
        if saves.are_due(at) {
            let write = || save(dir, at.training, &job.origin);
            if let Err(error) = interrupt::whole(write) {
                failed = Some(error);
                return ControlFlow::Break(());
            }
            kept.store(at.epoch, Ordering::SeqCst);
        }
        ControlFlow::Continue(())
    };
    let ended = training.run(&job.data.training, None, &mut observer);
    bar.finish_and_clear();
    ended?;
    match failed {
        Some(error) => Err(anyhow!(error)).context("training stopped, since it cannot be saved"),
        None => Ok(()),
    }
}

/// What Ctrl-C leaves of a training of `of` epochs.
fn kept_epochs(dir: &Path, kept: &Arc<AtomicUsize>, of: usize) -> impl Fn() -> String + use<> {
    let (dir, kept) = (dir.display().to_string(), Arc::clone(kept));
    move || match kept.load(Ordering::SeqCst) {
        0 => "before the first checkpoint; nothing was written".to_owned(),
        epoch => format!("{dir} has {epoch} of {of} epochs; {}", interrupt::go_on()),
    }
}
