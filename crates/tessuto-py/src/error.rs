//! The library's errors as the package's exceptions.

use pyo3::prelude::*;
use tessuto::{Error, Hint};

use crate::remedy;

/// The exception of `error`: class, place, cause and remedy are its own.
pub fn to_python(py: Python<'_>, error: &Error) -> PyErr {
    let says =
        |place: &str, problem: &str, hint: &Hint| (place.to_owned(), problem.to_owned(), remedy::hint(hint));
    let (class, (place, cause, remedy)) = match error {
        Error::Usage { problem, hint } => ("UsageError", says("", problem, hint)),
        Error::Input { place, problem, hint } => ("InputError", says(place, problem, hint)),
        Error::Numerical { place, problem, hint } => ("NumericalError", says(place, problem, hint)),
        Error::Output { path, source } => {
            let hint = "check free space and permissions, or choose another folder".into();
            ("OutputError", says(&path.display().to_string(), &source.to_string(), &hint))
        }
        Error::Interrupted(place) => ("InterruptedError", says(place, "interrupted", &"start again".into())),
        other => ("Error", says("", &other.to_string(), &Hint::from(""))),
    };
    let made = py
        .import("tessuto._errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call1((place, cause, remedy)));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// What these functions refuse themselves: arrays and numbers that do not match, named by `problem`.
pub fn refused(problem: impl Into<String>) -> PyErr {
    let error =
        Error::input("", problem, "see the arguments' shapes and units in the documentation: help(tessuto)");
    Python::attach(|py| to_python(py, &error))
}

/// A library result as Python's.
pub trait IntoPython<T> {
    /// Its error as an exception.
    fn into_python(self, py: Python<'_>) -> PyResult<T>;
}

impl<T> IntoPython<T> for tessuto::Result<T> {
    fn into_python(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|error| to_python(py, &error))
    }
}
