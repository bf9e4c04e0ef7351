//! Channels `[joint][row]` as arrays of shape (rows, joints), and results as native Python types.

use numpy::ndarray::{Array2, ArrayViewD, Axis};
use numpy::{AllowTypeChange, IntoPyArray, PyArray2, PyArrayLikeDyn};
use pyo3::call::PyCallArgs;
use pyo3::prelude::*;
use serde::Serialize;

use crate::error::ResidynError;

/// Anything that NumPy can turn into an array of floats.
pub type ArrayLike<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// A vector of shape (rows,).
pub fn vector(name: &str, array: &ArrayLike<'_>) -> PyResult<Vec<f64>> {
    let view = array.as_array();
    match view.ndim() {
        1 => Ok(view.iter().copied().collect()),
        _ => Err(shape(name, &view, "(rows,)")),
    }
}

/// The columns of a matrix of shape (rows, joints), or (rows,) for a single joint.
pub fn columns(name: &str, array: &ArrayLike<'_>) -> PyResult<Vec<Vec<f64>>> {
    let view = array.as_array();
    match view.ndim() {
        1 => Ok(vec![view.iter().copied().collect()]),
        2 => {
            let columns = view.axis_iter(Axis(1));
            Ok(columns
                .map(|column| column.iter().copied().collect())
                .collect())
        }
        _ => Err(shape(name, &view, "(rows, joints)")),
    }
}

fn shape(name: &str, found: &ArrayViewD<'_, f64>, wanted: &str) -> PyErr {
    ResidynError::new_err(format!(
        "{name} has the shape {:?}; give an array of the shape {wanted}",
        found.shape()
    ))
}

/// Channels `[joint][row]` as an array of shape (rows, joints).
pub fn matrix<'py>(py: Python<'py>, channels: &[Vec<f64>]) -> Bound<'py, PyArray2<f64>> {
    let rows = channels.first().map_or(0, Vec::len);
    let at = |(row, joint): (usize, usize)| channels[joint][row];
    Array2::from_shape_fn((rows, channels.len()), at).into_pyarray(py)
}

/// A result with names: a class of `residyn.results`.
pub fn named<'py>(
    py: Python<'py>,
    class: &str,
    fields: impl PyCallArgs<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    py.import("residyn.results")?.getattr(class)?.call1(fields)
}

/// A result as Python's own lists, dictionaries and numbers.
pub fn plain<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).expect("results have only finite numbers and texts");
    py.import("json")?.call_method1("loads", (text,))
}
