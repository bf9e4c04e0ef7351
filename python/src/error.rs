use std::error::Error;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

pyo3::create_exception!(
    residyn,
    ResidynError,
    PyValueError,
    "What cannot be done: what is wrong, where (file, line, column), and what to do about it."
);

/// Raises what the library says.
pub trait OrRaise<T> {
    fn or_raise(self) -> PyResult<T>;
}

impl<T, E: Error> OrRaise<T> for Result<T, E> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| ResidynError::new_err(told(&error)))
    }
}

/// An error and its causes. One that the message before it contains is not repeated.
fn told(error: &dyn Error) -> String {
    let mut told = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let text = cause.to_string();
        if !told.contains(&text) {
            told = format!("{told}: {text}");
        }
        next = cause.source();
    }
    told
}
