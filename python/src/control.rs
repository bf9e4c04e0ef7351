use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use residyn::Library;
use residyn::read_plant;
use residyn_control::control::{
    Episode as Played, EpisodeError, Predictor, Simulated, Task, episode, with_controller,
};
use residyn_core::plant::Plant;
use residyn_core::streams::{Purpose, stream};
use residyn_train::{Backend, Checkpoint};

use crate::error::{OrRaise, ResidynError};
use crate::log::Log;
use crate::model::Model;
use crate::rig::task_of;
use crate::work::interruptible;

/// An episode of a plant under control.
#[pyclass(frozen, module = "residyn")]
pub struct Episode(Played);

#[pymethods]
impl Episode {
    /// What the sensors said and what was commanded: one row per step, and one for the end.
    #[getter]
    fn log(&self) -> Log {
        Log(self.0.stretch.log.clone())
    }

    /// The reward of each step, shape (steps,).
    #[getter]
    fn rewards<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.rewards.clone().into_pyarray(py)
    }

    /// The sum of the rewards.
    #[getter]
    fn total(&self) -> f64 {
        self.0.total()
    }

    /// Whether the goal of the task held to the end.
    #[getter]
    fn success(&self) -> bool {
        self.0.success
    }

    fn __repr__(&self) -> String {
        let held = if self.0.success { "" } else { " not" };
        format!(
            "<residyn.Episode: return {:.2}, the goal did{held} hold to the end>",
            self.0.total()
        )
    }
}

/// What to plan with: a model, or the checkpoint of a trained one.
#[derive(FromPyObject)]
pub enum Planned<'py> {
    Model(PyRef<'py, Model>),
    Checkpoint(PathBuf),
}

impl Planned<'_> {
    fn predictor(&self, task: &Task) -> PyResult<Predictor> {
        match self {
            Self::Model(model) => {
                model.inner.stands_alone("a planner").or_raise()?;
                let dynamics = model.inner.dynamics();
                Ok(Predictor::of_equations(dynamics, task.integrator))
            }
            Self::Checkpoint(folder) => {
                let (checkpoint, _, trained) =
                    Checkpoint::open(folder, &Library::built_in(), Backend::default())
                        .or_raise_at(folder)?;
                Ok(trained.predictor(checkpoint.manifest.settings.integrator))
            }
        }
    }
}

/// What is asked.
struct Question {
    plant: Plant,
    task: Task,
    predictor: Predictor,
    seed: u64,
}

impl Question {
    fn episode(&self, number: usize) -> Result<Played, EpisodeError> {
        let Self {
            plant,
            task,
            predictor,
            seed,
        } = self;
        let mut rng = stream(*seed, Purpose::Judge(number));
        let dynamics = plant.dynamics();
        let start = task.draw_start(&mut rng);
        let rig = task.rig(plant, &dynamics, &start);
        let draws = stream(*seed, Purpose::JudgePlan(number));
        with_controller(predictor, task, task.replan, &draws, |controller| {
            episode(task, &mut Simulated { rig, noise: rng }, controller)
        })
    }
}

/// Control a simulated plant by model-predictive control with a receding horizon.
///
/// Args:
///     model: what to plan with: a model, or the folder of a trained model's checkpoint.
///     plant: a plant or model file, or a built-in plant or system by its name.
///     task: a task file, or a built-in task; by default a built-in one of the plant's system.
///     episodes: how many.
///     seed: for starts, noise and plans; the same seed gives the same episodes.
///
/// Returns:
///     The episodes.
///
/// Raises:
///     ResidynError: files that cannot be read, a model of another system, or a plant that diverges.
#[pyfunction]
#[pyo3(signature = (model, plant, task=None, *, episodes=1, seed=0))]
#[allow(clippy::needless_pass_by_value)]
pub fn control(
    py: Python<'_>,
    model: Planned<'_>,
    plant: PathBuf,
    task: Option<PathBuf>,
    episodes: usize,
    seed: u64,
) -> PyResult<Vec<Episode>> {
    let plant = read_plant(&plant, &Library::built_in()).or_raise_at(&plant)?;
    let task = task_of(&plant, task.as_deref())?;
    let predictor = model.predictor(&task)?;
    if predictor.joints() != task.joints() {
        return Err(ResidynError::new_err(format!(
            "the model {} has {} joints, but the plant {} has {}; plan with a model of the plant's system",
            predictor.system(),
            predictor.joints(),
            plant.system.name,
            task.joints()
        )));
    }
    let question = Question {
        plant,
        task,
        predictor,
        seed,
    };
    let played = interruptible(
        py,
        move |listener| -> Result<Vec<_>, EpisodeError> {
            let each = (0..episodes).map(|number| {
                listener.tell(());
                question.episode(number)
            });
            each.collect()
        },
        |()| Ok(()),
    )?;
    Ok(played.or_raise()?.into_iter().map(Episode).collect())
}
