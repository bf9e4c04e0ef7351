use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use residyn::Library;
use residyn_io::runs::RunFolder;
use residyn_train::recipe::{Job, Recipe, RecipeError, Saves, TrainingResults};
use residyn_train::{Backend, Checkpoint, Progress, save};

use crate::arrays::plain;
use crate::error::{OrRaise, ResidynError};
use crate::work::{Listener, interruptible};

/// How many epochs are done out of how many, and the loss of the last.
type Message = (usize, usize, f64);

/// Train a hybrid, physics-only or data-driven model from scratch, on logs or on a simulated plant.
///
/// The same call resumes an interrupted run, and ends with the same numbers.
///
/// Args:
///     config: the training recipe: a file, or a dictionary with the keys of one, where paths are relative to the working
///         directory.
///     out: the folder of the checkpoint.
///     seed: of everything random; the same seed gives the same result on the same machine.
///     progress: called after each epoch with the number of epochs done, their total, and the loss.
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
    config: Config,
    out: PathBuf,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'_, PyAny>> {
    let recipe = config.recipe(py)?;
    let begin = move || Job::train(recipe, &Library::built_in(), Backend::default(), seed);
    carry_out(py, begin, out, progress)
}

/// Fine-tune a trained model on new data.
///
/// Args:
///     checkpoint: the folder of the trained model.
///     out: the folder of the new checkpoint.
///     config: a recipe, a file or a dictionary as for `train`; or
///     logs: log files, for a recipe that suits most cases.
///     seed: of everything random.
///     progress: called after each epoch with the number of epochs done, their total, and the loss.
///
/// Returns:
///     Errors and parameters before and after, as `train` returns them.
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
    config: Option<Config>,
    logs: Vec<PathBuf>,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'_, PyAny>> {
    if config.is_some() != logs.is_empty() {
        return Err(ResidynError::new_err(
            "give either config= or logs= to tune on",
        ));
    }
    let recipe = config.map(|config| config.recipe(py)).transpose()?;
    let checkpoint = Checkpoint::load(&checkpoint).or_raise_at(&checkpoint)?;
    let begin = move || {
        let (library, backend) = (Library::built_in(), Backend::default());
        match recipe {
            Some(recipe) => Job::tune(&checkpoint, recipe, &library, backend, seed),
            None => Job::tune_on_logs(&checkpoint, logs, &library, backend, seed),
        }
    };
    carry_out(py, begin, out, progress)
}

/// A recipe as a notebook has it.
#[derive(FromPyObject)]
pub enum Config {
    File(PathBuf),
    Keys(Py<PyDict>),
}

impl Config {
    fn recipe(self, py: Python<'_>) -> PyResult<Recipe> {
        match self {
            Self::File(path) => Recipe::read(&path).or_raise_at(&path),
            Self::Keys(keys) => {
                let options = PyDict::new(py);
                // Paths may be those of pathlib.
                options.set_item("default", py.import("os")?.getattr("fspath")?)?;
                let json = py
                    .import("json")?
                    .call_method("dumps", (keys,), Some(&options))?;
                Recipe::from_json(json.extract()?).or_raise()
            }
        }
    }
}

fn carry_out(
    py: Python<'_>,
    begin: impl FnOnce() -> Result<Job, RecipeError> + Send + 'static,
    out: PathBuf,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'_, PyAny>> {
    let heard = |message: Message| match &progress {
        Some(callback) => callback.call1(py, message).map(drop),
        None => Ok(()),
    };
    let results = interruptible(
        py,
        move |listener| trained(&begin()?, &out, listener),
        heard,
    )?;
    plain(py, &results.or_raise()?)
}

/// Continues the run in a folder; if it is stopped, its progress is saved.
fn trained(
    job: &Job,
    out: &Path,
    listener: &Listener<Message>,
) -> Result<TrainingResults, RecipeError> {
    let folder = RunFolder::open(out)?;
    let mut training = job.begin(&folder)?;
    let mut saves = Saves::new(Saves::EVERY);
    let mut failed = None;
    let mut observer = |at: &Progress<'_>| {
        let message = listener.tell_or_stop((at.epoch, at.epochs, at.loss));
        if message.is_break() || saves.are_due(at) {
            failed = save(out, at.training, &job.origin).err();
        }
        match failed {
            Some(_) => ControlFlow::Break(()),
            None => message,
        }
    };
    training.run(&job.data.training, None, &mut observer)?;
    match failed {
        Some(error) => Err(error.into()),
        None => Ok(job.results(&training, out)?),
    }
}
