use std::path::{Path, PathBuf};

use numpy::{IntoPyArray, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use residyn::{Library, Log as Recorded, exported_task, read_log, read_model};
use residyn_core::sim::metric::{assess, needed_torques, summarise, torque_error, traces};
use residyn_core::sim::{Environment, Integrator};
use residyn_formats as formats;
use residyn_formats::ExportModel;
use serde_json::json;

use crate::arrays::{ArrayLike, columns, matrix, named, plain, vector};
use crate::error::{OrRaise, ResidynError};
use crate::library::Effects;
use crate::log::Log;

/// A dynamics model: equations with parameters, and the effects that were found.
#[pyclass(frozen, module = "residyn")]
pub struct Model {
    pub inner: residyn::Model,
    /// The effects that it may lack.
    pub library: Library,
}

/// A physical parameter of a model, or of one of its effects.
#[pyclass(frozen, get_all, module = "residyn")]
pub struct Parameter {
    /// Its name in the equations.
    name: String,
    /// In `unit`.
    value: f64,
    /// SI; empty for a pure number.
    unit: String,
    /// 95 % interval, lower end first, once a fit has found one.
    ci95: Option<(f64, f64)>,
    /// Held at this value in every fit.
    fixed: bool,
}

#[pymethods]
impl Parameter {
    fn __repr__(&self) -> String {
        let interval =
            (self.ci95).map_or_else(String::new, |(low, high)| format!(" ({low} to {high})"));
        format!(
            "<residyn.Parameter {} = {}{interval} {}>",
            self.name, self.value, self.unit
        )
    }
}

impl Model {
    /// A model file, or a built-in system by its name.
    pub fn of_library(library: Library, path: &Path) -> PyResult<Self> {
        let inner = read_model(path, &library).or_raise_at(path)?;
        Ok(Self { inner, library })
    }

    /// The model of a robot description, with a warning about anything that the model does not take over.
    fn described(
        py: Python<'_>,
        format: &str,
        path: &Path,
        tip: Option<&str>,
        drive: Option<&str>,
        effects: Effects<'_>,
    ) -> PyResult<Self> {
        let format = formats::find(format).expect("called with the names of formats");
        let reader = format
            .robots
            .as_ref()
            .expect("called with robot descriptions");
        let (inner, notes) = reader.model(path, tip, drive).or_raise_at(path)?;
        let library = effects.library()?;
        warn(py, &notes).map(|()| Self { inner, library })
    }
}

/// A warning for each note.
fn warn(py: Python<'_>, notes: &[String]) -> PyResult<()> {
    let category = py.get_type::<pyo3::exceptions::PyUserWarning>();
    for note in notes {
        let text = std::ffi::CString::new(note.as_str())
            .map_err(|_| PyValueError::new_err("a note holds NUL"))?;
        PyErr::warn(py, &category, &text, 1)?;
    }
    Ok(())
}

#[pymethods]
#[allow(clippy::needless_pass_by_value)] // arguments from Python become owned values
impl Model {
    /// A model file, or a built-in system by its name.
    ///
    /// Args:
    ///     path: a file, or one of `residyn.names("systems")`.
    ///     effects: a `Library`, or folders of your own effect files in addition to the built-in ones; `close_loop`
    ///         then considers them.
    ///
    /// Returns:
    ///     The model.
    ///
    /// Raises:
    ///     ResidynError: with file, line and column, what is wrong and what to do.
    #[staticmethod]
    #[pyo3(signature = (path, *, effects=Effects::default()))]
    fn read(path: PathBuf, effects: Effects<'_>) -> PyResult<Self> {
        Self::of_library(effects.library()?, &path)
    }

    /// The model in the text of a model file.
    ///
    /// Args:
    ///     text: what the file would hold.
    ///     name: what messages call the text.
    ///     effects: as for `read`.
    ///
    /// Returns:
    ///     The model.
    ///
    /// Raises:
    ///     ResidynError: with line and column, what is wrong and what to do.
    #[staticmethod]
    #[pyo3(signature = (text, *, name="model.toml", effects=Effects::default()))]
    fn from_text(text: &str, name: &str, effects: Effects<'_>) -> PyResult<Self> {
        let library = effects.library()?;
        let inner = library.model_from_text(name, text).or_raise()?;
        Ok(Self { inner, library })
    }

    /// The serial chain of a URDF: every link's inertia is a parameter, declared with its value in the file.
    ///
    /// Args:
    ///     path: the file.
    ///     tip: the last link; without it, the end of the longest branch.
    ///     drive: what drives the joints, if logs hold commands: one of `residyn.names("drives")`.
    ///     effects: as for `read`.
    ///
    /// Returns:
    ///     The model, whose parameters are the masses, centres and inertias of the links.
    ///
    /// Raises:
    ///     ResidynError: a file that cannot be read or holds no serial chain, or an unknown drive.
    ///
    /// Warns:
    ///     UserWarning: about what is read differently or not at all.
    #[staticmethod]
    #[pyo3(signature = (path, *, tip=None, drive=None, effects=Effects::default()))]
    fn from_urdf(
        py: Python<'_>,
        path: PathBuf,
        tip: Option<&str>,
        drive: Option<&str>,
        effects: Effects<'_>,
    ) -> PyResult<Self> {
        Self::described(py, "urdf", &path, tip, drive, effects)
    }

    /// The serial chain of a MuJoCo MJCF file: every link's inertia is a parameter; position actuators are adopted.
    ///
    /// Args:
    ///     path: the file.
    ///     tip: the last body; without it, the end of the longest branch.
    ///     drive: what drives the joints, if logs hold commands: one of `residyn.names("drives")`.
    ///     effects: as for `read`.
    ///
    /// Returns:
    ///     The model.
    ///
    /// Raises:
    ///     ResidynError: a file that cannot be read or holds no serial chain, or an unknown drive.
    ///
    /// Warns:
    ///     UserWarning: about what is read differently or not at all.
    #[staticmethod]
    #[pyo3(signature = (path, *, tip=None, drive=None, effects=Effects::default()))]
    fn from_mjcf(
        py: Python<'_>,
        path: PathBuf,
        tip: Option<&str>,
        drive: Option<&str>,
        effects: Effects<'_>,
    ) -> PyResult<Self> {
        Self::described(py, "mjcf", &path, tip, drive, effects)
    }

    /// The name of the system.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// The number of joints.
    #[getter]
    fn joints(&self) -> usize {
        self.inner.joints
    }

    /// Names of the joints in a URDF or on the rig; empty if they only have numbers.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.inner.joint_names.clone()
    }

    /// All parameters, those of effects after those of the equations.
    #[getter]
    fn parameters(&self) -> Vec<Parameter> {
        let all = self.inner.all_parameters().into_iter();
        all.map(|parameter| Parameter {
            ci95: parameter.ci95.map(|[low, high]| (low, high)),
            name: parameter.name,
            value: parameter.value,
            unit: parameter.unit,
            fixed: parameter.fixed,
        })
        .collect()
    }

    /// The effects in the model, for people: "coulomb_friction on joint 1".
    #[getter]
    fn effects(&self) -> Vec<String> {
        self.inner
            .effects
            .iter()
            .map(residyn_core::model::FittedEffect::label)
            .collect()
    }

    /// The effects that it may lack, which `close_loop` considers.
    #[getter]
    fn library(&self) -> crate::library::Library {
        crate::library::Library(self.library.clone())
    }

    /// The text of the model file.
    #[getter]
    fn text(&self) -> &str {
        &self.inner.text
    }

    /// The declared equations in LaTeX.
    ///
    /// Returns:
    ///     One text per equation; for a chain of bodies, their form.
    fn latex(&self) -> Vec<String> {
        self.inner.latex()
    }

    /// Write the model file.
    ///
    /// Args:
    ///     path: the file; an existing one is replaced.
    ///
    /// Raises:
    ///     ResidynError: a folder that cannot be written.
    fn write(&self, path: PathBuf) -> PyResult<()> {
        residyn_io::files::write_whole(&path, self.inner.text.as_bytes()).or_raise()
    }

    /// Read a log of this rig in any supported format, by the model's `[columns]`.
    ///
    /// Args:
    ///     path: the file, or the folder of a LeRobot data set.
    ///
    /// Returns:
    ///     The log.
    ///
    /// Raises:
    ///     ResidynError: with file, line and column, what is wrong and what to do.
    fn read_log(&self, py: Python<'_>, path: PathBuf) -> PyResult<Log> {
        py.detach(|| read_log(&path, &self.inner))
            .or_raise_at(&path)
            .map(Log)
    }

    /// Predictions of a log, open loop: over consecutive windows of `horizon_s`, the motion from the logged state at the
    /// start of each, under the logged torques.
    ///
    /// Args:
    ///     log: of a rig with the same number of joints.
    ///     horizon_s: length of a window in s.
    ///
    /// Returns:
    ///     A `Prediction` per window: `time` in s, shape (rows,), and `q`, joint angles in rad (or m),
    ///     shape (rows, joints).
    ///
    /// Raises:
    ///     ResidynError: a log of another rig, or a horizon that is not above zero.
    #[pyo3(signature = (log, horizon_s=1.0))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        log: &Log,
        horizon_s: f64,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        self.check(log)?;
        check_seconds("horizon", horizon_s)?;
        let found = py.detach(|| traces(&self.inner.dynamics(), &log.0, horizon_s));
        let predictions = found.into_iter().map(|trace| {
            let q = matrix(py, &trace.q);
            named(py, "Prediction", (trace.time.into_pyarray(py), q))
        });
        predictions.collect()
    }

    /// The torques that the logged motion needs according to the model, and the logged ones, both low-passed.
    ///
    /// Args:
    ///     log: of a rig with the same number of joints.
    ///
    /// Returns:
    ///     `Torques`: `time` in s, shape (rows,); `logged` and `needed` in N m (or N), shape (rows, joints).
    ///
    /// Raises:
    ///     ResidynError: a model that gives accelerations, or a log of another rig.
    fn torques<'py>(&self, py: Python<'py>, log: &Log) -> PyResult<Bound<'py, PyAny>> {
        self.check(log)?;
        let found = py.detach(|| needed_torques(&self.inner, &log.0));
        let found = found.ok_or_else(|| self.no_torques())?;
        let (logged, needed) = (matrix(py, &found.logged), matrix(py, &found.needed));
        named(py, "Torques", (found.time.into_pyarray(py), logged, needed))
    }

    /// Prediction errors on logs, as `residyn evaluate --json` prints them.
    ///
    /// Args:
    ///     logs: to predict.
    ///     horizons_s: how far ahead, in s.
    ///     torque: compare the torques that the motion needs with the logged ones as well.
    ///
    /// Returns:
    ///     `horizons_s`, and for each horizon, one number per joint: `position_rmse` and `position_median` in rad (or
    ///     m), `velocity_rmse` in rad/s (or m/s); `windows`, `diverged`. With `torque`, `torque`: `rms` of each joint
    ///     in N m (or N) and `relative`.
    ///
    /// Raises:
    ///     ResidynError: logs that are shorter than a horizon.
    #[pyo3(signature = (logs, horizons_s=vec![0.1, 0.5, 1.0], *, torque=false))]
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        logs: Vec<PyRef<'py, Log>>,
        horizons_s: Vec<f64>,
        torque: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        logs.iter().try_for_each(|log| self.check(log))?;
        horizons_s
            .iter()
            .try_for_each(|horizon_s| check_seconds("horizon", *horizon_s))?;
        let logs: Vec<Recorded> = logs.iter().map(|log| log.0.clone()).collect();
        let summary = py.detach(|| {
            let assessed = assess(&self.inner.dynamics(), &logs, &horizons_s);
            summarise(&assessed.horizons, self.inner.joints)
        });
        if let Some(short) = summary.windows.iter().position(|count| *count == 0) {
            return Err(ResidynError::new_err(format!(
                "no window of {} s fits into the logs; give longer logs or a shorter horizon",
                horizons_s[short]
            )));
        }
        let found = plain(py, &summary)?;
        if torque {
            let error = py.detach(|| torque_error(&self.inner, &logs));
            let error = error.ok_or_else(|| self.no_torques())?;
            found.set_item("torque", plain(py, &error)?)?;
        }
        Ok(found)
    }

    /// Integrate the model from a state, holding each torque (or command) for `step_s`.
    ///
    /// Args:
    ///     state: positions, then velocities, shape (2 joints,).
    ///     tau: shape (steps, joints), or (steps,) for one joint.
    ///     step_s: how long each torque is held, in s.
    ///     integrator: "rk4", "semi_implicit_euler" or "fine:N" for N substeps.
    ///
    /// Returns:
    ///     The states, the first one included, shape (steps + 1, 2 joints).
    ///
    /// Raises:
    ///     ResidynError: a state or torques of another shape, an integrator that is unknown, or a step that is not above zero.
    #[pyo3(signature = (state, tau, step_s, integrator="rk4"))]
    fn rollout<'py>(
        &self,
        py: Python<'py>,
        state: ArrayLike<'py>,
        tau: ArrayLike<'py>,
        step_s: f64,
        integrator: &str,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (mut state, tau) = (vector("state", &state)?, columns("tau", &tau)?);
        let joints = self.inner.joints;
        if state.len() != 2 * joints || tau.len() != joints {
            return Err(ResidynError::new_err(format!(
                "{} has {joints} joint(s): give a state of {} numbers and torques of the shape (steps, {joints})",
                self.inner.name,
                2 * joints
            )));
        }
        let integrator = integrator_of(integrator)?;
        check_seconds("step", step_s)?;
        self.inner.runs_without_logs("a simulation").or_raise()?;
        let dynamics = self.inner.dynamics();
        let mut environment = Environment::new(&dynamics, integrator, step_s);
        let mut states: Vec<Vec<f64>> = state.iter().map(|value| vec![*value]).collect();
        for step in 0..tau[0].len() {
            let held: Vec<f64> = tau.iter().map(|of_joint| of_joint[step]).collect();
            #[allow(clippy::cast_precision_loss)] // steps are far fewer than 2^52
            environment.step(&mut state, &held, step as f64 * step_s);
            for (states, value) in states.iter_mut().zip(&state) {
                states.push(*value);
            }
        }
        Ok(matrix(py, &states))
    }

    /// Write the model for other programs.
    ///
    /// Args:
    ///     format: one of `residyn.names("formats")`: "c", "onnx", "fmi3" ...
    ///     path: the file to write; formats with several files put the others next to it.
    ///     step_s: how long a torque is held, in s.
    ///     integrator: "rk4", "semi_implicit_euler" or "fine:N" for N substeps.
    ///
    /// Returns:
    ///     What of the model the format cannot represent, one sentence each.
    ///
    /// Raises:
    ///     ResidynError: a format that is unknown or cannot carry the model, or a folder that cannot be written.
    #[pyo3(signature = (format, path, *, step_s=0.01, integrator="rk4"))]
    fn export(
        &self,
        py: Python<'_>,
        format: &str,
        path: PathBuf,
        step_s: f64,
        integrator: &str,
    ) -> PyResult<Vec<String>> {
        let format = formats::find(format).or_raise()?;
        check_seconds("step", step_s)?;
        let origin = json!({"config": {"model": self.inner.name}, "seed": 0});
        let model = ExportModel::of_system(&self.inner, integrator_of(integrator)?, step_s, origin)
            .with_task(exported_task(&self.inner.name));
        py.detach(|| format.write(&model, &path)).or_raise()?;
        Ok((format.not_carried)(&model))
    }

    fn __repr__(&self) -> String {
        format!(
            "<residyn.Model {}: {} joint(s)>",
            self.inner.name, self.inner.joints
        )
    }
}

impl Model {
    /// Whether a log is of a rig with the same number of joints, driven by the same quantity.
    ///
    /// # Errors
    /// What differs.
    pub fn check(&self, log: &Log) -> PyResult<()> {
        let (model, log) = (&self.inner, &log.0);
        if log.joints() != model.joints {
            return Err(ResidynError::new_err(format!(
                "{} has {} joint(s), {} has {}; give a log of this rig",
                log.name(),
                log.joints(),
                model.name,
                model.joints
            )));
        }
        if log.driven_by != model.driven_by() {
            return Err(ResidynError::new_err(format!(
                "{} has `{}`, {} is driven by `{}`; give these, or a model whose [drive] turns commands into torques",
                log.name(),
                log.driven_by.key(),
                model.name,
                model.driven_by().key()
            )));
        }
        Ok(())
    }

    fn no_torques(&self) -> PyErr {
        ResidynError::new_err(format!(
            "{} gives accelerations or the logs are shorter than a second; state it as `mass` and `bias`, or as a chain",
            self.inner.name
        ))
    }
}

/// Whether a length of time is valid; `what` is for the message.
fn check_seconds(what: &str, seconds: f64) -> PyResult<()> {
    match seconds > 0.0 && seconds.is_finite() {
        true => Ok(()),
        false => Err(ResidynError::new_err(format!(
            "a {what} of {seconds} s: give a number of seconds above zero"
        ))),
    }
}

fn integrator_of(name: &str) -> PyResult<Integrator> {
    name.parse::<Integrator>().or_raise()
}
