//! Shared by `train` and `tune`: run a job with a progress bar and checkpoints, and print the results.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use clap::Args;

use super::{Answer, Common, inputs, progress};
use crate::runs::RunFolder;
use crate::train::recipe::{Job, Saves};
use crate::train::{Progress, Training, save};

/// Where and how often to save.
#[derive(Debug, Args)]
pub(super) struct Saving {
    /// Folder of the checkpoint; a run that was interrupted is resumed from its last checkpoint
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Epochs between checkpoints; one is also written when 10 s have passed
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
        eprintln!("note: {note}");
    }
    let mut training = job.begin(&folder)?;
    if training.epoch() > 0 {
        eprintln!(
            "note: {} goes on from epoch {}",
            dir.display(),
            training.epoch()
        );
    }
    run(job, &mut training, dir, saving)?;
    let results = job.results(&training, dir)?;
    if common.json {
        inputs::print(&(serde_json::to_string_pretty(&results)? + "\n"))?;
    } else {
        inputs::print(&results.text())?;
    }
    Ok(Answer::Yes)
}

fn run(job: &Job, training: &mut Training, dir: &Path, saving: &Saving) -> Result<()> {
    let bar = progress::bar(training.settings().epochs);
    let mut saves = Saves::new(saving.save_every);
    let mut failed = None;
    let mut observer = |at: &Progress| {
        bar.set_position(at.epoch as u64);
        bar.set_message(format!("epochs, loss {:.3e}", at.loss));
        if saves.are_due(at)
            && let Err(error) = save(dir, at.training, &job.origin)
        {
            failed = Some(error);
            return ControlFlow::Break(());
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
