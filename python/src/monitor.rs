use std::collections::BTreeMap;

use pyo3::prelude::*;
use residyn_monitor::{Alarm, Rows, Settings};

use crate::arrays::{ArrayLike, columns, plain, vector};
use crate::error::{OrRaise, ResidynError};
use crate::log::Log;
use crate::model::Model;

/// A watch on a running machine: its rows go in as they come, alarms come out.
///
/// Args:
///     model: fitted to the machine when it was well.
///     false_alarms_per_hour: over everything that is watched.
///     healthy_s: length of the first stretch, in which the machine is well, in s.
///     block_s: length of the blocks whose scores are taken as one draw, in s.
///     smoothing_s: half the width of the window over which forces are averaged, in s; by default 120 ms, or fifteen steps of
///         slower logs.
///     payload_at: where a load at the tip is expected in the frame of the last body, in m; by default its centre of mass.
///
/// Raises:
///     ResidynError: settings out of their range, or a model that cannot be watched.
#[pyclass(module = "residyn")]
pub struct Monitor {
    inner: residyn_monitor::Monitor,
    measured: Vec<String>,
}

#[pymethods]
#[allow(clippy::needless_pass_by_value)]
impl Monitor {
    #[new]
    #[pyo3(signature = (model, *, false_alarms_per_hour=0.1, healthy_s=300.0, block_s=1.0, smoothing_s=None, payload_at=None))]
    fn new(
        model: PyRef<'_, Model>,
        false_alarms_per_hour: f64,
        healthy_s: f64,
        block_s: f64,
        smoothing_s: Option<f64>,
        payload_at: Option<[f64; 3]>,
    ) -> PyResult<Self> {
        let settings = Settings {
            false_alarms_per_hour,
            healthy_s,
            block_s,
            smoothing_s,
            payload_at,
        };
        Ok(Self {
            inner: residyn_monitor::Monitor::new(&model.inner, settings).or_raise()?,
            measured: model.inner.measured_names().map(str::to_owned).collect(),
        })
    }

    /// Take the next rows.
    ///
    /// Args:
    ///     rows: a `Log`, or a dictionary of arrays: `time`, shape (rows,), `q` and `tau` or `cmd`, shape (rows, joints), and
    ///         the model's further measured columns by their names, shape (rows,).
    ///
    /// Returns:
    ///     The alarms that they raise, each a dictionary with `time_s`, `since_s`, `kind`, `joint`, `name`, `estimate`, `or`,
    ///     `is_further` and `message`.
    ///
    /// Raises:
    ///     ResidynError: rows out of order, numbers that are not finite, or columns that are missing.
    fn update<'py>(&mut self, py: Python<'py>, rows: Batch<'py>) -> PyResult<Bound<'py, PyAny>> {
        let names = self.measured.iter().map(String::as_str);
        let rows = match rows {
            Batch::Log(log) => Rows::of_log(&log.0, names).or_raise()?,
            Batch::Arrays(arrays) => rows_of(&arrays, names)?,
        };
        let inner = &mut self.inner;
        let alarms: Vec<Alarm> = py.detach(|| inner.update(&rows)).or_raise()?;
        plain(py, &alarms)
    }

    /// What was seen so far, and how small a change would have been seen within an hour.
    ///
    /// Returns:
    ///     A dictionary with `rows`, `watched_s`, `is_calibrated`, `gaps`, `jumps`, `repeated_rows`, `alarms`, `followed`,
    ///     `disturbances` and `limits`.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.inner.summary())
    }
}

/// Rows of a machine.
#[derive(FromPyObject)]
pub enum Batch<'py> {
    Log(PyRef<'py, Log>),
    Arrays(BTreeMap<String, ArrayLike<'py>>),
}

fn rows_of<'n>(
    arrays: &BTreeMap<String, ArrayLike<'_>>,
    measured: impl Iterator<Item = &'n str>,
) -> PyResult<Rows> {
    let find = |name: &str| {
        let found = arrays.get(name);
        found.ok_or_else(|| ResidynError::new_err(format!("the rows have no {name:?}")))
    };
    let (driven, name) = match arrays.contains_key("cmd") {
        true => (find("cmd")?, "cmd"),
        false => (find("tau")?, "tau"),
    };
    let measured = measured.map(|name| vector(name, find(name)?));
    Ok(Rows {
        time: vector("time", find("time")?)?,
        q: columns("q", find("q")?)?,
        driven: columns(name, driven)?,
        measured: measured.collect::<PyResult<_>>()?,
    })
}
