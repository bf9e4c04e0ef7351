//! Inputs that several commands share: libraries, models, logs.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;

use super::{remedy, terminal};
use residyn_core::data::{Audit, Finding, LeaveOut, Log, leave_out, together};
use residyn_core::limits::RUNS;
use residyn_core::model::check::Severity;
use residyn_core::model::{Library, Model};
use residyn_io::effect_files;
use residyn_io::with_effects_in;

/// The effects that model files may name: the built-in ones and the user's own.
#[derive(Debug, Args)]
pub(super) struct Effects {
    /// Folders with your own effect files
    #[arg(long = "effects", num_args = 1.., value_name = "DIR")]
    pub folders: Vec<PathBuf>,
}

impl Effects {
    pub fn library(&self) -> Result<Library> {
        let mut library = Library::built_in();
        for folder in &self.folders {
            library = with_effects_in(folder, library)?;
        }
        Ok(library)
    }

    /// The effect files in the folders.
    pub fn files(&self) -> Result<Vec<PathBuf>> {
        let folders = self.folders.iter().map(|folder| effect_files(folder));
        Ok(folders.collect::<Result<Vec<_>, _>>()?.concat())
    }
}

/// The model of a command.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub(super) struct ModelArguments {
    /// Checkpoint of a trained model
    #[arg(long, value_name = "DIR")]
    checkpoint: Option<PathBuf>,
    /// Model file, or the name of a built-in system
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
}

/// How many logs, models, episodes or simulations a flag asks for.
pub(super) fn count(text: &str) -> Result<NonZeroUsize, String> {
    match text.parse() {
        Ok(count) if count <= RUNS => NonZeroUsize::new(count),
        _ => None,
    }
    .ok_or_else(|| format!("write a whole number from 1 to {RUNS}"))
}

/// A horizon of errors in s.
pub(super) fn horizon(text: &str) -> Result<f64, String> {
    let horizon_s = text
        .parse()
        .ok()
        .filter(|of: &f64| *of > 0.0 && of.is_finite());
    horizon_s.ok_or_else(|| "a horizon is a number of seconds above zero".to_owned())
}

/// The source of a model.
pub(super) enum Source<'a> {
    Checkpoint(&'a Path),
    File(&'a Path),
}

impl ModelArguments {
    pub fn source(&self) -> Source<'_> {
        match (&self.checkpoint, &self.model) {
            (Some(dir), _) => Source::Checkpoint(dir),
            (_, Some(file)) => Source::File(file),
            _ => unreachable!("clap asks for one of both"),
        }
    }
}

/// Apply `--leave-out` to two sets of logs at once: an entry may name a log of either.
pub(super) fn leave_out(
    train: &mut Vec<Log>,
    test: &mut Vec<Log>,
    entries: &[LeaveOut],
) -> Result<()> {
    let boundary = train.len();
    let mut all: Vec<Log> = train.drain(..).chain(test.drain(..)).collect();
    leave_out::apply(&mut all, entries)?;
    test.extend(all.drain(boundary..));
    train.extend(all);
    Ok(())
}

/// Print on standard error what is implausible in a model, before anything is computed with it.
pub(super) fn print_findings(path: &Path, model: &Model, seed: u64) {
    for finding in model.check(&mut residyn_core::rng(seed)).findings {
        let label = match finding.severity {
            Severity::Error => "serious",
            Severity::Warning => "warning",
        };
        terminal::say(format!("{label}: {}: {finding}", path.display()));
    }
}

/// Print the notes of logs on standard error.
pub(super) fn print_notes<'l>(logs: impl IntoIterator<Item = &'l Log>) {
    let logs: Vec<&Log> = logs.into_iter().collect();
    let of_log = |log: &&Log| {
        let name = log.name();
        let notes = log.notes.iter();
        notes
            .map(move |note| (name.clone(), note.clone()))
            .collect::<Vec<_>>()
    };
    for note in together(logs.iter().flat_map(of_log)) {
        terminal::say(format!("note: {}: {}", note.about(logs.len()), note.text));
    }
}

/// The model with what is known of each log alone, which is printed on standard error.
pub(super) fn with_values_of<'l>(
    model: &Model,
    logs: impl IntoIterator<Item = &'l Log>,
) -> Result<Model> {
    let known = residyn_io::with_values_of(model, logs)?;
    for table in &known.configurations[model.configurations.len()..] {
        let values = table.given.iter();
        let values = values.map(|(k, value)| format!("{} = {value}", model.parameters[*k].name));
        let values = values.collect::<Vec<_>>().join(", ");
        terminal::say(format!("note: {}: in this log {values}", table.pattern));
    }
    Ok(known)
}

/// Print on standard error what is serious about logs, before anything is computed from them.
pub(super) fn print_faults<'a>(audits: impl IntoIterator<Item = &'a Audit>) {
    let audits: Vec<&Audit> = audits.into_iter().collect();
    let of_audit = |audit: &&'a Audit| {
        let (log, serious) = (audit.log.clone(), audit.serious());
        let message = |finding: &Finding| finding.message(&remedy::of_finding);
        serious.map(move |finding| (log.clone(), message(finding)))
    };
    for fault in together(audits.iter().flat_map(of_audit)) {
        terminal::say(format!(
            "serious: {}: {}",
            fault.about(audits.len()),
            fault.text
        ));
    }
}
