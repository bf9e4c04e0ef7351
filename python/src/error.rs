use std::error::Error;
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::Path;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use residyn_io::files::OutputError;

pyo3::create_exception!(
    residyn,
    ResidynError,
    PyValueError,
    "An operation that cannot be done: what is wrong, where (file, line, column), and what to do about it.\n\n\
     If a file is missing or may not be opened, it is also a FileNotFoundError or a PermissionError with its `filename`."
);

/// Raises what the library says.
pub trait OrRaise<T> {
    fn or_raise(self) -> PyResult<T>;

    /// As above, for an operation that reads a path.
    fn or_raise_at(self, path: &Path) -> PyResult<T>;
}

impl<T, E: Error + 'static> OrRaise<T> for Result<T, E> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| raised(&error, written(&error)))
    }

    fn or_raise_at(self, path: &Path) -> PyResult<T> {
        self.map_err(|error| {
            let unreadable = unreadable(path).map(|why| (why, path));
            raised(&error, unreadable.or_else(|| written(&error)))
        })
    }
}

/// Why a path cannot be opened, if so. Messages of the library hold it only as text.
fn unreadable(path: &Path) -> Option<io::Error> {
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => None,
        Ok(_) => File::open(path).err(),
        Err(why) => Some(why),
    }
}

/// What could not be written, and why, if that is the error.
fn written<'a>(error: &'a (dyn Error + 'static)) -> Option<(io::Error, &'a Path)> {
    let mut causes = std::iter::successors(Some(error), |error| (**error).source());
    let output = causes.find_map(|cause| cause.downcast_ref::<OutputError>())?;
    Some((output.source.kind().into(), &output.path))
}

/// A `ResidynError`; if the operating system refuses a file, one that is also Python's own class for that.
fn raised(error: &dyn Error, refused: Option<(io::Error, &Path)>) -> PyErr {
    let message = message(error);
    let class = refused.and_then(|(why, path)| {
        let class = match why.kind() {
            ErrorKind::NotFound => "ResidynFileNotFoundError",
            ErrorKind::PermissionDenied => "ResidynPermissionError",
            ErrorKind::IsADirectory => "ResidynIsADirectoryError",
            _ => return None,
        };
        Some((class, path))
    });
    match class {
        None => ResidynError::new_err(message),
        Some((class, path)) => {
            Python::attach(|py| of_file(py, class, &message, path).unwrap_or_else(|error| error))
        }
    }
}

fn of_file(py: Python<'_>, class: &str, message: &str, path: &Path) -> PyResult<PyErr> {
    let class = py.import("residyn._errors")?.getattr(class)?;
    let error = class.call_method1("of_file", (message, path))?;
    Ok(PyErr::from_value(error))
}

/// An error and its causes. A cause that the message before it contains is not repeated.
fn message(error: &dyn Error) -> String {
    let mut message = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let text = cause.to_string();
        if !message.contains(&text) {
            message = format!("{message}: {text}");
        }
        next = cause.source();
    }
    message
}
