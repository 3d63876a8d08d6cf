//! Keyword arguments, which are taken by name. An argument that nothing takes is an error, which names the most similar one.

use crate::error::usage;
use caustique::options::{ValueEnum, one_of};
use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::fmt::Display;
use std::ops::RangeBounds;

/// The keyword arguments of a Python call, and the names that have been taken.
pub struct Keywords<'py> {
    call: &'static str,
    given: Bound<'py, PyDict>,
    known: Vec<String>,
}

impl<'py> Keywords<'py> {
    /// Keyword arguments `given` to the Python function `call`.
    pub fn of(py: Python<'py>, call: &'static str, given: Option<&Bound<'py, PyDict>>) -> Self {
        Keywords { call, given: given.cloned().unwrap_or_else(|| PyDict::new(py)), known: Vec::new() }
    }

    /// Takes the argument `name`; `None` if it is None or missing.
    ///
    /// # Errors
    /// The argument has the wrong type, or is a number that does not fit the type.
    pub fn take<T: FromPyObjectOwned<'py>>(&mut self, name: &str) -> PyResult<Option<T>> {
        self.known.push(name.to_string());
        let Some(value) = self.given.get_item(name)?.filter(|value| !value.is_none()) else { return Ok(None) };
        value.extract::<T>().map(Some).map_err(|error| {
            let error: PyErr = error.into();
            let text = format!("{}() argument '{name}': {}", self.call, error.value(value.py()));
            match error.is_instance_of::<PyTypeError>(value.py()) {
                true => PyTypeError::new_err(text),
                false => PyValueError::new_err(text),
            }
        })
    }

    /// Takes the argument `name`, a number within a range; `None` if it is missing. `say` describes the range for
    /// errors.
    ///
    /// # Errors
    /// The number is out of range.
    pub fn number<T>(&mut self, name: &str, range: impl RangeBounds<T>, say: &str) -> PyResult<Option<T>>
    where
        T: FromPyObjectOwned<'py> + PartialOrd + Display,
    {
        match self.take::<T>(name)? {
            Some(value) if !range.contains(&value) => {
                Err(usage(format!("{}: {name}={value} is out of range", self.call), format!("{name} is {say}")))
            }
            value => Ok(value),
        }
    }

    /// Takes the argument `name`, one of the names of an enum; `None` if it is missing.
    ///
    /// # Errors
    /// The name does not exist.
    pub fn choice<T: ValueEnum>(&mut self, name: &str) -> PyResult<Option<T>> {
        let Some(given) = self.take::<String>(name)? else { return Ok(None) };
        choice(&format!("{}: {name}", self.call), &given).map(Some)
    }

    /// Whether the argument `name` has been taken.
    pub fn has_taken(&self, name: &str) -> bool {
        self.known.iter().any(|known| known == name)
    }

    /// Name of the Python function that is called.
    pub fn call(&self) -> &'static str {
        self.call
    }

    /// The value of the argument `name` in Python's notation, or `?`.
    pub fn shown(&self, name: &str) -> String {
        let value = self.given.get_item(name).ok().flatten();
        value.and_then(|value| value.repr().ok()).map_or_else(|| "?".into(), |shown| shown.to_string())
    }

    /// Fails if an argument was given that nothing has taken.
    pub fn check_all_taken(self) -> PyResult<()> {
        for (key, _) in self.given.iter() {
            let key: String = key.extract()?;
            if !self.has_taken(&key) {
                let matches = nearest(&self.given, &key, &self.known)?;
                let hint = matches.map(|near| format!("; did you mean '{near}'?")).unwrap_or_default();
                let call = self.call;
                return Err(PyTypeError::new_err(format!("{call}() got an unexpected keyword argument '{key}'{hint}")));
            }
        }
        Ok(())
    }
}

/// The enum's value that the name `given` stands for. `place` names the argument in errors.
///
/// # Errors
/// The name does not exist.
pub fn choice<T: ValueEnum>(place: &str, given: &str) -> PyResult<T> {
    one_of(given).map_err(|names| usage(format!("{place}='{given}' does not exist"), names))
}

/// The known argument name that is most similar to the unknown `key`, by Python's difflib; `None` if none is similar.
fn nearest(given: &Bound<'_, PyDict>, key: &str, known: &[String]) -> PyResult<Option<String>> {
    let matches = given.py().import("difflib")?.call_method1("get_close_matches", (key, known.to_vec(), 1))?;
    Ok(matches.extract::<Vec<String>>()?.into_iter().next())
}
