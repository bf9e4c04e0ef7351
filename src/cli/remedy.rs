use std::error::Error;
use std::io::{self, ErrorKind};
use std::path::Path;

use anyhow::Chain;

use residyn_control::control::NoTask;
use residyn_core::closeloop::StudyError;
use residyn_core::data::Remedy;
use residyn_core::model::{FileError, FileRemedy};
use residyn_experiments::experiment::ExperimentError;
use residyn_formats::ExportError;
use residyn_io::files::OutputError;
use residyn_io::runs::{MergeError, RunFolderError};
use residyn_plants::AddressError;
use residyn_train::recipe::RecipeError;
use residyn_validation::GridError;
use residyn_validation::rigs::RigsError;

/// The error number of too many open files, the same on all Unix systems.
const EMFILE: i32 = 24;

/// How to predict a log that a fit has not seen.
pub(super) fn prediction(model: &Path) -> String {
    format!(
        "predict another log: residyn evaluate --model {} --test LOG",
        model.display()
    )
}

/// What to do about an error, in terms of the command line, which the library knows nothing about.
pub(super) fn remedy(error: &(dyn Error + 'static)) -> Option<&'static str> {
    None.or_else(|| of_open_files(error))
        .or_else(|| error.downcast_ref().and_then(of_address))
        .or_else(|| error.downcast_ref().and_then(of_output))
        .or_else(|| error.downcast_ref().and_then(of_folder))
        .or_else(|| error.downcast_ref().and_then(of_merge))
        .or_else(|| error.downcast_ref().and_then(of_task))
        .or_else(|| error.downcast_ref().and_then(of_recipe))
        .or_else(|| error.downcast_ref().and_then(of_experiment))
        .or_else(|| error.downcast_ref().and_then(of_grid))
        .or_else(|| error.downcast_ref().and_then(of_rigs))
        .or_else(|| error.downcast_ref().and_then(of_file))
        .or_else(|| error.downcast_ref().and_then(of_study))
        .or_else(|| error.downcast_ref().and_then(of_export))
}

/// What fixes a finding about a log, ready to paste.
pub(super) fn of_finding(remedy: &Remedy) -> String {
    match remedy {
        Remedy::LeaveOut(spans) => format!("--leave-out {}", spans.join(" ")),
        Remedy::Columns(_) => remedy.to_string(),
    }
}

/// What to do if a disk is full.
const FULL: &str = "free some space, or give another folder with --out";

/// For a process with as many open files as it may have: a merge has one open in each part.
fn of_open_files(error: &(dyn Error + 'static)) -> Option<&'static str> {
    let is_it = |cause: &(dyn Error + 'static)| {
        let cause: Option<&io::Error> = cause.downcast_ref();
        cfg!(unix) && cause.and_then(io::Error::raw_os_error) == Some(EMFILE)
    };
    Chain::new(error)
        .any(is_it)
        .then_some("raise the limit with `ulimit -n`, or merge a few of the parts at a time")
}

fn of_address(error: &AddressError) -> Option<&'static str> {
    matches!(error, AddressError::OtherMachine(_)).then_some("use a tunnel, or --plant-elsewhere")
}

fn of_output(error: &OutputError) -> Option<&'static str> {
    Some(match error.source.kind() {
        ErrorKind::InvalidInput => "move it away, or give another name with --out",
        ErrorKind::NotFound => "make the folder first, or give another with --out",
        ErrorKind::StorageFull => FULL,
        _ => "give another folder with --out",
    })
}

fn of_folder(error: &RunFolderError) -> Option<&'static str> {
    match error {
        RunFolderError::Busy { .. } => {
            Some("wait until that has ended, or give another folder with --out")
        }
        RunFolderError::OtherRun { .. } | RunFolderError::Damaged { .. } => {
            Some("give another folder with --out, or remove this one to start over")
        }
        RunFolderError::Io { source, .. } if source.kind() == ErrorKind::StorageFull => Some(FULL),
        RunFolderError::NotAFolder { .. } | RunFolderError::Io { .. } => {
            Some("give a writable folder with --out")
        }
        RunFolderError::Output(_) => None,
    }
}

fn of_merge(error: &MergeError) -> Option<&'static str> {
    match error {
        MergeError::NoPart { .. } => Some("give folders that a command with --shard wrote"),
        MergeError::OtherRun { .. } => {
            Some("leave it out, or run it again with the settings and the program of the others")
        }
        MergeError::TwoResults { .. } => Some("leave the wrong one's folder out"),
        _ => None,
    }
}

fn of_task(error: &NoTask) -> Option<&'static str> {
    let may_be_given = !matches!(error, NoTask::Invalid(_));
    may_be_given.then_some("name it with --task")
}

fn of_recipe(error: &RecipeError) -> Option<&'static str> {
    match error {
        RecipeError::Open { .. } => Some("give a recipe with --config"),
        RecipeError::NoAlpha { .. } => Some("or leave out --alpha"),
        _ => None,
    }
}

fn of_experiment(error: &ExperimentError) -> Option<&'static str> {
    let cannot_open = matches!(error, ExperimentError::Recipe(RecipeError::Open { .. }));
    cannot_open.then_some("give a file with --config")
}

fn of_grid(error: &GridError) -> Option<&'static str> {
    matches!(error, GridError::Open { .. }).then_some("give a grid with --grid")
}

fn of_rigs(error: &RigsError) -> Option<&'static str> {
    match error {
        RigsError::Open { .. } => Some("give a file of rigs with --rigs"),
        RigsError::NoLogs { .. } => {
            Some("give the folder of measured logs with --data, or other rigs with --only")
        }
        _ => None,
    }
}

fn of_file(error: &FileError) -> Option<&'static str> {
    error.remedy.map(|remedy| match remedy {
        FileRemedy::Tip => "--tip names the last body",
    })
}

fn of_study(error: &StudyError) -> Option<&'static str> {
    match error {
        StudyError::NoTest { .. } => Some("--test names the test logs"),
        StudyError::NoTorques { .. } => Some("--errors motion compares the motion"),
        StudyError::NotOfMotion => {
            Some("leave --calibrate out, or compare the motion with --errors motion")
        }
        StudyError::TooManyParameters { .. } | StudyError::Log(_) | StudyError::Fit(_) => None,
    }
}

fn of_export(error: &ExportError) -> Option<&'static str> {
    matches!(error, ExportError::Delay { .. }).then_some("set it with --step")
}
