use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use residyn::{
    Library, Log as Recorded, Model as Declared, Origin, Reference, Request, Settings, rng,
};
use residyn_core::closeloop::{
    ErrorModel, Fits, Progress, Split, Stage, StageTimes, StudyError, Watch,
};
use residyn_report as report;
use residyn_report::Report;
use residyn_train::{Backend, ResidualTrainer};
use serde_json::json;

use crate::error::{OrRaise, ResidynError};
use crate::log::Log;
use crate::model::Model;
use crate::work::{Listener, interruptible};

/// Everything that closing the loop found out; `residyn.Report` shows it.
#[pyclass(frozen, module = "residyn")]
pub struct Outcome {
    /// A lock, since a trained network may move between threads, but not be shared.
    found: Mutex<residyn::Outcome>,
    origin: Origin,
    report: Report,
    library: Library,
}

#[pymethods]
impl Outcome {
    /// The report as values.
    ///
    /// Returns:
    ///     The text of report.json.
    fn json(&self) -> String {
        serde_json::to_string(&self.report).expect("a report has only finite numbers and texts")
    }

    /// The report as a self-contained page for a browser.
    ///
    /// Returns:
    ///     HTML.
    fn html(&self) -> String {
        report::page(&self.report)
    }

    /// The report as Markdown; its pictures are files of `write`.
    ///
    /// Returns:
    ///     Markdown.
    fn markdown(&self) -> String {
        report::text(&self.report)
    }

    /// The declared model with the effects that were found, refitted.
    ///
    /// Returns:
    ///     A model with the library of the declared one.
    fn model(&self) -> PyResult<Model> {
        let text = report::model_file(&self.lock());
        let library = self.library.clone();
        let inner = library.model_from_text("model.toml", &text).or_raise()?;
        Ok(Model { inner, library })
    }

    /// Write report.html, report.md, report.json, model.toml, plots and the network into a folder.
    ///
    /// Args:
    ///     folder: created if it is missing.
    ///
    /// Raises:
    ///     ResidynError: a folder that cannot be written.
    #[allow(clippy::needless_pass_by_value)]
    fn write(&self, folder: PathBuf) -> PyResult<()> {
        report::write(folder, &self.lock(), &self.origin).or_raise()?;
        Ok(())
    }
}

impl Outcome {
    fn lock(&self) -> std::sync::MutexGuard<'_, residyn::Outcome> {
        self.found
            .lock()
            .expect("nothing that reads an outcome panics")
    }
}

/// What is asked.
struct Question {
    model: Declared,
    library: Library,
    split: Split,
    against: Vec<Reference>,
    error_model: Option<ErrorModel>,
    budget: Duration,
    network: bool,
    seed: u64,
}

/// A stage, what is being done in it, and how many fits are done out of how many.
type Message = (&'static str, String, Option<(usize, usize)>);

/// Tells Python what is done, and ends the search when its time is spent.
struct Watcher<'l> {
    listener: &'l Listener<Message>,
    /// `None` if the search may take longer than a clock counts.
    deadline: Option<Instant>,
    start: Instant,
    times: Mutex<StageTimes>,
}

impl Watch for Watcher<'_> {
    fn see(&self, now: Progress<'_>) {
        let times = self.times.lock();
        times
            .unwrap_or_else(PoisonError::into_inner)
            .note(now.stage, self.start.elapsed());
        let fits = now.fits.map(|Fits { done, of }| (done, of));
        self.listener
            .tell((now.stage.text(), now.text.to_owned(), fits));
    }

    fn has_to_end(&self) -> bool {
        self.deadline
            .is_some_and(|deadline| Instant::now() >= deadline)
    }
}

impl Question {
    fn answer(&self, listener: &Listener<Message>) -> Result<residyn::Outcome, StudyError> {
        let learner = ResidualTrainer {
            backend: Backend::default(),
        };
        let mut request = Request::new(&self.model, &self.library, self.split.clone());
        request.against.clone_from(&self.against);
        request.error_model = self.error_model;
        if self.network {
            request.learner = Some(&learner);
        }
        let start = Instant::now();
        let watcher = Watcher {
            listener,
            deadline: start.checked_add(self.budget),
            start,
            times: Mutex::new(StageTimes::default()),
        };
        let mut outcome = residyn::close_loop(request, &mut rng(self.seed), &watcher)?;
        let times = watcher.times.into_inner();
        let times = times.unwrap_or_else(PoisonError::into_inner);
        outcome.seconds = times.end(start.elapsed());
        Ok(outcome)
    }

    fn origin(&self) -> Origin {
        let names =
            |logs: &[Recorded]| -> Vec<String> { logs.iter().map(Recorded::name).collect() };
        let against: Vec<&str> = self
            .against
            .iter()
            .map(|other| other.name.as_str())
            .collect();
        Origin {
            config: json!({
                "command": "close_loop",
                "model": self.model.name,
                "train": names(&self.split.train),
                "test": names(&self.split.test),
                "against": against,
                "errors": self.error_model,
                "budget_s": self.budget.as_secs_f64(),
                "network": self.network,
            }),
            seed: self.seed,
            model_toml: self.model.declaration.clone(),
            call: None,
        }
    }
}

/// See `residyn.close_loop`, which has the same arguments.
#[pyfunction]
#[pyo3(signature = (model, train, test, against, seed, budget_s, errors, network, progress))]
#[allow(clippy::too_many_arguments, clippy::needless_pass_by_value)] // as in the Python function
pub fn close_loop(
    py: Python<'_>,
    model: &Model,
    train: Vec<PyRef<'_, Log>>,
    test: Vec<PyRef<'_, Log>>,
    against: Vec<(String, PyRef<'_, Model>)>,
    seed: u64,
    budget_s: f64,
    errors: Option<&str>,
    network: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Outcome> {
    train
        .iter()
        .chain(&test)
        .try_for_each(|log| model.check(log))?;
    let recorded = |logs: &[PyRef<'_, Log>]| logs.iter().map(|log| log.0.clone()).collect();
    let references = against.iter().map(|(name, other)| Reference {
        name: name.clone(),
        model: other.inner.clone(),
    });
    let question = Question {
        model: model.inner.clone(),
        library: model.library.clone(),
        split: split(recorded(&train), recorded(&test))?,
        against: references.collect(),
        error_model: errors.map(error_model).transpose()?,
        budget: Duration::try_from_secs_f64(budget_s)
            .map_err(|why| ResidynError::new_err(format!("budget_s = {budget_s}: {why}")))?,
        network,
        seed,
    };
    let origin = question.origin();
    let heard = |(stage, text, fits): Message| match &progress {
        Some(callback) => {
            let (done, of) = fits.unzip();
            callback.call1(py, (stage, text, done, of)).map(drop)
        }
        None => Ok(()),
    };
    let found = interruptible(py, move |listener| question.answer(listener), heard)?.or_raise()?;
    Ok(Outcome {
        report: Report::new(&found, &origin),
        found: Mutex::new(found),
        origin,
        library: model.library.clone(),
    })
}

fn split(train: Vec<Recorded>, test: Vec<Recorded>) -> PyResult<Split> {
    let split = match test.is_empty() {
        true => Split::of(train, &Settings::default().split),
        false => Split::given(train, test),
    };
    match split.test.is_empty() {
        true => Err(ResidynError::new_err(
            "the logs are too short to set any of them apart for the test; give test=",
        )),
        false => Ok(split),
    }
}

fn error_model(errors: &str) -> PyResult<ErrorModel> {
    match errors {
        "motion" => Ok(ErrorModel::OutputError),
        "torque" => Ok(ErrorModel::InverseDynamics),
        _ => Err(ResidynError::new_err(format!(
            "errors = {errors:?}: give \"motion\", \"torque\", or None to choose the more informative for these logs"
        ))),
    }
}

/// The stages of closing the loop.
///
/// Returns:
///     Their names in order, as `progress` receives them.
#[pyfunction]
pub fn stages() -> Vec<&'static str> {
    Stage::ALL.map(Stage::text).to_vec()
}
