use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use residyn::read_plant;
use residyn::{Library, rng};
use residyn_control::control::Task;
use residyn_control::plan::Objective;
use residyn_core::data::Joint;
use residyn_core::model::Dynamics;
use residyn_core::plant;
use residyn_core::plant::Plant;
use self_cell::self_cell;

use crate::arrays::{ArrayLike, named, vector};
use crate::error::{OrRaise, ResidynError};
use crate::library;
use crate::log::Log;

type Controlled<'d> = plant::Rig<'d>;

self_cell!(
    /// A rig in motion, with its equations of motion.
    struct Moving {
        owner: Dynamics,
        #[not_covariant]
        dependent: Controlled,
    }
);

/// A simulated rig with a task, step by step: `residyn.environment.Environment` makes a Gymnasium environment of it.
///
/// Args:
///     plant: a plant or model file, or a built-in plant or system by its name.
///     task: a task file, or a built-in task; by default a built-in one of the plant's system.
///
/// Raises:
///     ResidynError: files that cannot be read, or a task of another system.
#[pyclass(module = "residyn")]
pub struct Rig {
    plant: Plant,
    task: Task,
    objective: Objective,
    random: rand_chacha::ChaCha8Rng,
    moving: Option<Moving>,
}

#[pymethods]
#[allow(clippy::needless_pass_by_value)]
impl Rig {
    #[new]
    #[pyo3(signature = (plant, task=None))]
    fn new(plant: PathBuf, task: Option<PathBuf>) -> PyResult<Self> {
        let plant = read_plant(&plant, &Library::built_in()).or_raise_at(&plant)?;
        let task = task_of(&plant, task.as_deref())?;
        Ok(Self {
            objective: task.objective(),
            random: rng(0),
            moving: None,
            plant,
            task,
        })
    }

    /// The number of joints.
    #[getter]
    fn joints(&self) -> usize {
        self.task.joints()
    }

    /// What may be commanded: `Bounds` with the `low` and `high` torque (N m or N) or command of each joint, each of the
    /// shape (joints,).
    #[getter]
    fn action_bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let ends = [0, 1].map(|end| -> Vec<f64> {
            let torque = self.task.torque.iter();
            torque.map(|range| range[end]).collect()
        });
        let [low, high] = ends.map(|end| end.into_pyarray(py));
        named(py, "Bounds", (low, high))
    }

    /// How long a torque is held, in s.
    #[getter]
    fn step_s(&self) -> f64 {
        self.task.step_s
    }

    /// How many steps an episode of the task has.
    #[getter]
    fn episode_steps(&self) -> usize {
        self.task.steps
    }

    /// Begin an episode, from a start state that is drawn from the task's.
    ///
    /// Args:
    ///     seed: with one, everything random from here on is drawn anew from it.
    ///
    /// Returns:
    ///     The measured state: positions, then velocities, shape (2 joints,).
    #[pyo3(signature = (seed=None))]
    fn reset<'py>(&mut self, py: Python<'py>, seed: Option<u64>) -> Bound<'py, PyArray1<f64>> {
        if let Some(seed) = seed {
            self.random = rng(seed);
        }
        let start = self.task.draw_start(&mut self.random);
        let moving = Moving::new(self.plant.dynamics(), |dynamics| {
            self.task.rig(&self.plant, dynamics, &start)
        });
        let moving = self.moving.insert(moving);
        let random = &mut self.random;
        moving
            .with_dependent_mut(|_, rig| rig.measure(random))
            .into_pyarray(py)
    }

    /// Hold a torque (or command) for a step.
    ///
    /// Args:
    ///     tau: torque of each joint in N m (or N), shape (joints,).
    ///
    /// Returns:
    ///     `Step`: the measured `state`, shape (2 joints,), and the `reward` of the step by the task.
    ///
    /// Raises:
    ///     ResidynError: before `reset`, a torque of another size, or a plant that diverges.
    fn step<'py>(&mut self, py: Python<'py>, tau: ArrayLike<'py>) -> PyResult<Bound<'py, PyAny>> {
        let tau = vector("tau", &tau)?;
        if tau.len() != self.task.joints() {
            return Err(ResidynError::new_err(format!(
                "{} torque(s) for {} joint(s); give one each",
                tau.len(),
                self.task.joints()
            )));
        }
        let (random, objective) = (&mut self.random, &self.objective);
        let moving = self.moving.as_mut();
        let moving = moving
            .ok_or_else(|| ResidynError::new_err("the rig has no state yet; call reset first"))?;
        moving.with_dependent_mut(|_, rig| {
            rig.step(&tau).or_raise()?;
            let reward = objective.value(rig.state(), &tau, rig.time_s());
            named(py, "Step", (rig.measure(random).into_pyarray(py), reward))
        })
    }
}

/// The task in a file, or a built-in one.
pub fn task_of(plant: &Plant, task: Option<&Path>) -> PyResult<Task> {
    let found = Task::for_plant(plant, task);
    match task {
        Some(path) => found.or_raise_at(path),
        None => found.or_raise(),
    }
}

/// The log of a simulated rig.
///
/// Args:
///     plant: a plant or model file, or a built-in plant or system by its name.
///     effects: what its model does not declare: the value of an effect's first parameter, or of several by their names;
///         "coulomb_friction@2" is on joint 2.
///     seed: for excitation and noise; the same seed gives the same log.
///     duration_s: instead of the plant's own.
///     name: what messages and reports call the log; by default the plant's name and the seed.
///     library: the effects to choose from; by default the built-in ones.
///
/// Returns:
///     The readings of the rig's sensors, and its torques or commands.
///
/// Raises:
///     ResidynError: a plant or effect that is unknown, or a rig that diverges.
#[pyfunction]
#[pyo3(signature = (plant, *, effects=BTreeMap::new(), seed=0, duration_s=None, name=None, library=None))]
#[allow(clippy::needless_pass_by_value)]
pub fn simulate(
    py: Python<'_>,
    plant: PathBuf,
    effects: BTreeMap<String, Values>,
    seed: u64,
    duration_s: Option<f64>,
    name: Option<PathBuf>,
    library: Option<PyRef<'_, library::Library>>,
) -> PyResult<Log> {
    let library = library.map_or_else(Library::built_in, |library| library.0.clone());
    let mut plant = read_plant(&plant, &library).or_raise_at(&plant)?;
    for (at, values) in effects {
        let (effect, joint) = place(&at)?;
        let first = library.effect(effect).or_raise()?;
        let values = match values {
            Values::First(value) => vec![(first.parameters[0].name.clone(), value)],
            Values::Named(values) => values.into_iter().collect(),
        };
        plant
            .add_effect(&library, effect, joint, &values)
            .or_raise()?;
    }
    plant.recording.duration_s = duration_s.unwrap_or(plant.recording.duration_s);
    let named = || format!("{}-{seed}", plant.system.name).into();
    let path = name.unwrap_or_else(named);
    let log = py.detach(|| plant.record(&mut rng(seed))).or_raise()?;
    Ok(Log(residyn::Log { path, ..log }))
}

/// Values of an effect's parameters.
#[derive(FromPyObject)]
pub enum Values {
    First(f64),
    Named(BTreeMap<String, f64>),
}

/// `name` or `name@joint`.
fn place(at: &str) -> PyResult<(&str, Joint)> {
    match at.split_once('@') {
        None => Ok((at, Joint::at(0))),
        Some((name, joint)) => {
            let joint = joint.parse();
            joint.map(|joint| (name, joint)).map_err(|why| {
                ResidynError::new_err(format!(
                    "{at:?}: {why}; write an effect as name or name@joint"
                ))
            })
        }
    }
}
