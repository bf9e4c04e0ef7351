use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::exceptions::{PyImportError, PyKeyError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use residyn::{read_standard_log, write_log};
use residyn_core::data;
use residyn_core::data::{Channels, Interval, Quantity, audit};

use crate::arrays::{ArrayLike, columns, matrix, plain, vector};
use crate::error::{OrRaise, ResidynError};
use crate::model::Model;

/// One trajectory of a rig: what was recorded between switching it on and off.
///
/// Row i's torque, or command, acts from time[i] to time[i + 1]. `log["q1"]` is a column, `len(log)` the number of rows.
///
/// Args:
///     time: s, shape (rows,), strictly increasing; irregular sampling is fine.
///     q: joint angles in rad (m for sliding joints), shape (rows, joints), or (rows,) for one joint.
///     qd: joint velocities in rad/s, of the same shape; without them they are computed from the angles.
///     tau: joint torques in N m (N), of the same shape; without torques and commands, the rig is passive.
///     cmd: commands of the drives instead of torques: targets of servos, volts, amperes.
///     name: what messages and reports call the log.
///
/// Raises:
///     ResidynError: arrays of different lengths, numbers that are not finite, or time that does not increase.
#[pyclass(frozen, module = "residyn")]
pub struct Log(pub residyn::Log);

#[pymethods]
impl Log {
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
                    "give either tau or cmd: a log has the input of the model's drive",
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

    /// A log from a pandas or polars data frame, or from anything else that has `columns` and returns one by name.
    ///
    /// Args:
    ///     frame: with the columns of a log file: time, q1, ..., and qd1, ..., tau1, ... or cmd1, ...; or those that a
    ///         model's `[columns]` name. Others are ignored.
    ///     model: that of the rig; without it, the columns have the standard names and units.
    ///     name: what messages and reports call the log.
    ///
    /// Returns:
    ///     The log.
    ///
    /// Raises:
    ///     ResidynError: a column that is missing, numbers that are missing or not finite, or time that does not increase.
    #[staticmethod]
    #[pyo3(signature = (frame, *, model=None, name="log"))]
    fn from_dataframe(
        frame: &Bound<'_, PyAny>,
        model: Option<&Model>,
        name: &str,
    ) -> PyResult<Self> {
        let Columns { numbers, others } = columns_of(frame)?;
        let log = match model {
            Some(model) => model.inner.log_from_columns(name, numbers),
            None => residyn::Log::from_columns(name, numbers, None),
        };
        let log = log.map_err(|error| {
            let others = match others.is_empty() {
                true => String::new(),
                false => format!("; these columns hold no numbers: {}", others.join(", ")),
            };
            ResidynError::new_err(format!("{error}{others}"))
        });
        log.map(Self)
    }

    /// The log as a pandas data frame.
    ///
    /// Returns:
    ///     A pandas.DataFrame with the columns `columns`.
    ///
    /// Raises:
    ///     ImportError: pandas is not installed.
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.frame(py, "pandas")
    }

    /// The log as a polars data frame.
    ///
    /// Returns:
    ///     A polars.DataFrame with the columns `columns`.
    ///
    /// Raises:
    ///     ImportError: polars is not installed.
    fn to_polars<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.frame(py, "polars")
    }

    /// Names of the columns: time, q1, ..., qd1, ..., and tau1, ... or cmd1, ...
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.0.named_columns().map(|(name, _)| name).collect()
    }

    /// A column by its name, shape (rows,).
    ///
    /// Raises:
    ///     KeyError: no column has this name.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let mut columns = self.0.named_columns();
        let found = columns.find(|(column, _)| column == name);
        let (_, values) = found.ok_or_else(|| {
            let known = self.columns().join(", ");
            PyKeyError::new_err(format!("no column {name:?}; there are {known}"))
        })?;
        Ok(PyArray1::from_slice(py, values))
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

    /// What messages and reports call the log: for a file, its name.
    #[getter]
    fn name(&self) -> String {
        self.0.name()
    }

    /// What a reader of the log should know about how it was read, one sentence each.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.0.notes.clone()
    }

    /// The same log without the interval from start_s to end_s, which is neither fitted nor scored.
    ///
    /// Args:
    ///     start_s: start of the interval in s, in the log's own time.
    ///     end_s: end of the interval in s.
    ///
    /// Returns:
    ///     The log; `q` and the other arrays still have all rows.
    ///
    /// Raises:
    ///     ResidynError: an end that does not come after the start.
    fn leave_out(&self, start_s: f64, end_s: f64) -> PyResult<Self> {
        if !(start_s < end_s) {
            return Err(ResidynError::new_err(format!(
                "{start_s} to {end_s} s is not an interval of time; give a start before the end"
            )));
        }
        let mut log = self.0.clone();
        log.leave_out.push(Interval { start_s, end_s });
        Ok(Self(log))
    }

    /// What the log is good for: sampling, noise, lags, and a list of `findings`, the most serious first.
    ///
    /// Args:
    ///     model: its `[columns]` say what the columns of the file hold.
    ///
    /// Returns:
    ///     As `residyn audit --json` prints it; a finding has a `severity` ("serious", "warning" or "info") and a `text`.
    #[pyo3(signature = (model=None))]
    fn audit<'py>(&self, py: Python<'py>, model: Option<&Model>) -> PyResult<Bound<'py, PyAny>> {
        let columns =
            model.map_or_else(data::Columns::default, |model| model.inner.columns.clone());
        let found = py.detach(|| audit(&self.0, &columns));
        plain(py, &found)
    }

    /// Write the log as CSV with the columns time, q1, ..., qd1, ..., tau1, ... or cmd1, ...
    ///
    /// Args:
    ///     path: the file; an existing one is replaced.
    ///
    /// Raises:
    ///     ResidynError: a folder that cannot be written.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python become owned values
    fn write(&self, path: PathBuf) -> PyResult<()> {
        write_log(&self.0, path).or_raise()
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

impl Log {
    /// The columns as a data frame of a package.
    fn frame<'py>(&self, py: Python<'py>, package: &str) -> PyResult<Bound<'py, PyAny>> {
        let found = py.import(package).map_err(|missing| {
            let remedy = format!("to_{package} needs {package}: pip install {package}");
            let error = PyImportError::new_err(remedy);
            error.set_cause(py, Some(missing));
            error
        })?;
        let columns = PyDict::new(py);
        for (name, values) in self.0.named_columns() {
            columns.set_item(name, PyArray1::from_slice(py, values))?;
        }
        found.getattr("DataFrame")?.call1((columns,))
    }
}

/// The columns of a data frame.
struct Columns {
    numbers: Vec<(String, Vec<f64>)>,
    /// Names of the columns that hold texts, dates or anything else that is not a number.
    others: Vec<String>,
}

fn columns_of(frame: &Bound<'_, PyAny>) -> PyResult<Columns> {
    let numpy = frame.py().import("numpy")?;
    let mut columns = Columns {
        numbers: Vec::new(),
        others: Vec::new(),
    };
    for label in frame.getattr("columns")?.try_iter()? {
        let label = label?;
        // A column whose name is not a text is not a column of a log.
        let Ok(name) = label.extract::<String>() else {
            continue;
        };
        let array = numpy.call_method1("asarray", (frame.get_item(label)?,))?;
        let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
        // Dates would become numbers of nanoseconds.
        let numbers = match "mM".contains(&kind) {
            true => None,
            false => array.call_method1("astype", ("float64",)).ok(),
        };
        match numbers {
            Some(numbers) => {
                let numbers = vector(&name, &numbers.extract()?)?;
                columns.numbers.push((name, numbers));
            }
            None => columns.others.push(name),
        }
    }
    Ok(columns)
}

/// Read a log in any supported format, with the standard columns and as many joints as it has.
///
/// If columns have other names or units, the model says so: `Model.read_log`.
///
/// Args:
///     path: the file.
///
/// Returns:
///     The log.
///
/// Raises:
///     ResidynError: with file, line and column, what is wrong and what to do.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<Log> {
    py.detach(|| read_standard_log(&path))
        .or_raise_at(&path)
        .map(Log)
}
