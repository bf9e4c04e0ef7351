use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use residyn::Library;
use residyn::runs::RunFolder;
use residyn::train::recipe::{Job, Recipe, RecipeError, Saves, TrainingResults};
use residyn::train::{Backend, Checkpoint, Progress, save};

use crate::arrays::plain;
use crate::error::{OrRaise, ResidynError};
use crate::work::{Listener, interruptible};

/// How many epochs of how many are done, and the loss of the last.
type Told = (usize, usize, f64);

/// Train a hybrid, physics-only or data-driven model from scratch, on logs or on a simulated plant.
///
/// The same call goes on with a run that was interrupted, and ends with the same numbers.
///
/// Args:
///     config: the training recipe.
///     out: the folder of the checkpoint.
///     seed: of everything random; the same seed gives the same result on the same machine.
///     progress: called after each epoch with the number of epochs done, of all, and the loss.
///
/// Returns:
///     Errors and parameters before and after, as `residyn train --json` prints them.
///
/// Raises:
///     ResidynError: a recipe, model, plant or log that cannot be read, a folder with another run, or a loss that is no longer
///         finite.
#[pyfunction]
#[pyo3(signature = (config, out, *, seed=0, progress=None))]
#[allow(clippy::needless_pass_by_value)]
pub fn train(
    py: Python<'_>,
    config: PathBuf,
    out: PathBuf,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'_, PyAny>> {
    let begin = move || {
        Job::train(
            Recipe::read(&config)?,
            &Library::built_in(),
            Backend::default(),
            seed,
        )
    };
    carry_out(py, begin, out, progress)
}

/// Fine-tune a trained model on new data.
///
/// Args:
///     checkpoint: the folder of the trained model.
///     out: the folder of the new checkpoint.
///     config: a recipe; or
///     logs: files of logs, for a recipe that suits most.
///     seed: of everything random.
///     progress: called after each epoch with the number of epochs done, of all, and the loss.
///
/// Returns:
///     As `train`.
///
/// Raises:
///     ResidynError: as `train`, and a checkpoint of another system.
#[pyfunction]
#[pyo3(signature = (checkpoint, out, *, config=None, logs=Vec::new(), seed=0, progress=None))]
#[allow(clippy::needless_pass_by_value)]
pub fn tune(
    py: Python<'_>,
    checkpoint: PathBuf,
    out: PathBuf,
    config: Option<PathBuf>,
    logs: Vec<PathBuf>,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'_, PyAny>> {
    if config.is_some() != logs.is_empty() {
        return Err(ResidynError::new_err(
            "give either config= or logs= to tune on",
        ));
    }
    let begin = move || {
        let (library, backend) = (Library::built_in(), Backend::default());
        let checkpoint = Checkpoint::load(&checkpoint)?;
        match config {
            Some(config) => Job::tune(&checkpoint, Recipe::read(&config)?, &library, backend, seed),
            None => Job::tune_on_logs(&checkpoint, logs, &library, backend, seed),
        }
    };
    carry_out(py, begin, out, progress)
}

fn carry_out(
    py: Python<'_>,
    begin: impl FnOnce() -> Result<Job, RecipeError> + Send + 'static,
    out: PathBuf,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'_, PyAny>> {
    let heard = |told: Told| match &progress {
        Some(callback) => callback.call1(py, told).map(drop),
        None => Ok(()),
    };
    let results = interruptible(
        py,
        move |listener| trained(&begin()?, &out, listener),
        heard,
    )?;
    plain(py, &results.or_raise()?)
}

/// The run in a folder from where it stands; where it is stopped, what is done is saved.
fn trained(
    job: &Job,
    out: &Path,
    listener: &Listener<Told>,
) -> Result<TrainingResults, RecipeError> {
    let folder = RunFolder::open(out)?;
    let mut training = job.begin(&folder)?;
    let mut saves = Saves::new(Saves::EVERY);
    let mut failed = None;
    let mut observer = |at: &Progress<'_>| {
        let told = listener.tell_or_stop((at.epoch, at.epochs, at.loss));
        if told.is_break() || saves.are_due(at) {
            failed = save(out, at.training, &job.origin).err();
        }
        match failed {
            Some(_) => ControlFlow::Break(()),
            None => told,
        }
    };
    training.run(&job.data.training, None, &mut observer)?;
    match failed {
        Some(error) => Err(error.into()),
        None => Ok(job.results(&training, out)?),
    }
}
