use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use residyn::data::{Channels, Columns, Interval, Quantity, audit};

use crate::arrays::{ArrayLike, columns, matrix, plain, vector};
use crate::error::{OrRaise, ResidynError};
use crate::model::Model;

/// One trajectory of a rig: what was recorded between switching it on and off.
///
/// Row i's torque, or command, acts from time[i] to time[i + 1].
#[pyclass(frozen, module = "residyn")]
pub struct Log(pub residyn::Log);

#[pymethods]
impl Log {
    /// A log of arrays in memory.
    ///
    /// Args:
    ///     time: s, shape (rows,), strictly increasing; irregular sampling is fine.
    ///     q: joint angles in rad (m of joints that slide), shape (rows, joints), or (rows,) of one joint.
    ///     qd: joint velocities in rad/s; without them they come from the angles.
    ///     tau: joint torques in N m (N); without torques and commands, the rig is passive.
    ///     cmd: commands of the drives in place of torques: targets of servos, volts, amperes.
    ///     name: what messages and reports call the log.
    ///
    /// Raises:
    ///     ResidynError: arrays of other lengths, numbers that are not finite, or time that does not increase.
    #[new]
    #[pyo3(signature = (*, time, q, qd=None, tau=None, cmd=None, name="log"))]
    fn new(
        time: ArrayLike<'_>,
        q: ArrayLike<'_>,
        qd: Option<ArrayLike<'_>>,
        tau: Option<ArrayLike<'_>>,
        cmd: Option<ArrayLike<'_>>,
        name: &str,
    ) -> PyResult<Self> {
        let driven = match (tau, cmd) {
            (Some(_), Some(_)) => {
                return Err(ResidynError::new_err(
                    "give either tau or cmd: a log has what the model's drive is given",
                ));
            }
            (Some(tau), None) => Some((Quantity::Torque, columns("tau", &tau)?)),
            (None, Some(cmd)) => Some((Quantity::Command, columns("cmd", &cmd)?)),
            (None, None) => None,
        };
        let channels = Channels {
            time: vector("time", &time)?,
            q: columns("q", &q)?,
            qd: qd.map(|qd| columns("qd", &qd)).transpose()?,
            driven,
        };
        Ok(Self(channels.log(name).or_raise()?))
    }

    /// Time of each row in s, shape (rows,).
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.time.clone().into_pyarray(py)
    }

    /// Joint angles in rad (or m), shape (rows, joints).
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        matrix(py, &self.0.q)
    }

    /// Joint velocities in rad/s (or m/s), shape (rows, joints).
    #[getter]
    fn qd<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        matrix(py, &self.0.qd)
    }

    /// Joint torques in N m (or N), shape (rows, joints); None for a log of commands.
    #[getter]
    fn tau<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        (self.0.driven_by == Quantity::Torque).then(|| matrix(py, &self.0.tau))
    }

    /// Commands of the drives, shape (rows, joints); None for a log of torques.
    #[getter]
    fn cmd<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        (self.0.driven_by == Quantity::Command).then(|| matrix(py, &self.0.tau))
    }

    /// The number of joints.
    #[getter]
    fn joints(&self) -> usize {
        self.0.joints()
    }

    /// What messages and reports call the log: of a file, its name.
    #[getter]
    fn name(&self) -> String {
        self.0.name()
    }

    /// What a reader of the log should know about how it was read, one sentence each.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.0.notes.clone()
    }

    /// The same log without the stretch from start_s to end_s, in the log's own time: it is neither fitted nor scored.
    ///
    /// Raises:
    ///     ResidynError: an end that does not come after the start.
    fn leave_out(&self, start_s: f64, end_s: f64) -> PyResult<Self> {
        if !(start_s < end_s) {
            return Err(ResidynError::new_err(format!(
                "{start_s} to {end_s} s is no stretch of time; give a start before the end"
            )));
        }
        let mut log = self.0.clone();
        log.leave_out.push(Interval { start_s, end_s });
        Ok(Self(log))
    }

    /// What the log is good for: sampling, noise, lags, and a list of `findings`, the most serious first.
    ///
    /// Args:
    ///     model: whose `[columns]` say what the columns of the file hold.
    #[pyo3(signature = (model=None))]
    fn audit<'py>(&self, py: Python<'py>, model: Option<&Model>) -> PyResult<Bound<'py, PyAny>> {
        let columns = model.map_or_else(Columns::default, |model| model.inner.columns.clone());
        let found = py.detach(|| audit(&self.0, &columns));
        plain(py, &found)
    }

    /// Write the log as CSV with the columns time, q1, ..., qd1, ..., tau1, ... or cmd1, ...
    ///
    /// Raises:
    ///     ResidynError: a folder that cannot be written.
    #[allow(clippy::needless_pass_by_value)] // what Python gives is made into a path of our own
    fn write(&self, path: PathBuf) -> PyResult<()> {
        self.0.write(path).or_raise()
    }

    fn __len__(&self) -> usize {
        self.0.rows()
    }

    fn __repr__(&self) -> String {
        format!(
            "<residyn.Log {}: {} joint(s), {} rows, {:.3} s>",
            self.0.name(),
            self.0.joints(),
            self.0.rows(),
            self.0.duration()
        )
    }
}

/// Read a log of any format that is read, with the standard columns and as many joints as it has.
///
/// Where columns have other names or units, the model says so: `Model.read_log`.
///
/// Args:
///     path: the file.
///
/// Raises:
///     ResidynError: with file, line and column, what is wrong and what to do.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<Log> {
    py.detach(|| residyn::Log::read_standard(&path))
        .or_raise()
        .map(Log)
}
