//! The tables `[logs."pattern"]` of a model file, the values per log of its parameters, and what is known of one log alone.

use std::path::Path;

use super::Parameter;
use super::configuration::Configuration;
use super::dynamics::PerLogValue;
use super::effects_in_file::of_one_log;
use super::reader::{Document, FileError, Section};
use super::system::Model;
use super::tables::ParameterTable;
use super::values::Named;
use crate::data::Log;

/// The tables, in the order of the file.
pub(super) fn configurations(
    Named(tables): Named<Section<'_>>,
    parameters: &[Parameter],
) -> Result<Vec<Configuration>, FileError> {
    let table = |(pattern, section): (String, Section<'_>)| {
        let given = given(&section, parameters)?;
        Ok(Configuration { pattern, given })
    };
    tables.into_iter().map(table).collect()
}

/// The values that a table gives.
fn given(section: &Section<'_>, parameters: &[Parameter]) -> Result<Vec<(usize, f64)>, FileError> {
    let names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
    section.only(&names)?;
    let mut given = Vec::new();
    for (k, parameter) in parameters.iter().enumerate() {
        if let Some(value) = section.read(&parameter.name)? {
            let refused = |why| section.error_at(&parameter.name, why);
            check_value(parameter, value).map_err(refused)?;
            given.push((k, value));
        }
    }
    Ok(given)
}

/// Refuse a value of a parameter in single logs.
fn check_value(parameter: &Parameter, value: f64) -> Result<(), String> {
    let (name, [low, high]) = (&parameter.name, parameter.bounds);
    if parameter.per_log {
        return Err(format!(
            "`{name}` is fitted for each log or group, as its `per` says; remove that or this value"
        ));
    }
    match (low..=high).contains(&value) {
        true => Ok(()),
        false => Err(format!(
            "`{name}` is {value}, outside its bounds {low} to {high}"
        )),
    }
}

impl Model {
    /// The model with the values that hold in one log, as the text of a file beside it gives them: `kp = 40`. They win over
    /// those of tables for several logs. `path` is for messages.
    ///
    /// # Errors
    /// Anything but values of parameters, within their bounds, that are not fitted log by log.
    pub fn with_values_beside(
        &self,
        log: &Log,
        path: &Path,
        text: &str,
    ) -> Result<Self, FileError> {
        let document = Document::new(path, text);
        let given = given(&document.parse()?, &self.parameters)?;
        Ok(self.with_values_in(log, given))
    }

    /// The model with the values that a recording of this log has by the names of parameters, as far as the model file neither
    /// gives one for it nor asks a fit for it.
    ///
    /// # Errors
    /// Why a value cannot be one of its parameter.
    pub fn with_recorded_values(&self, log: &Log) -> Result<Self, String> {
        let mut given = Vec::new();
        for (k, parameter) in self.parameters.iter().enumerate() {
            let mut recorded = log.values.iter();
            let recorded = recorded.find(|(name, _)| *name == parameter.name);
            let is_known = || parameter.per_log || self.differing().value(k, false, log).is_some();
            if let Some((_, value)) = recorded.filter(|_| !is_known()) {
                check_value(parameter, *value)?;
                given.push((k, *value));
            }
        }
        Ok(self.with_values_in(log, given))
    }

    fn with_values_in(&self, log: &Log, given: Vec<(usize, f64)>) -> Self {
        let mut model = self.clone();
        if given.is_empty() {
            return model;
        }
        let values = given.iter();
        let values = values.map(|(k, value)| (self.parameters[*k].name.as_str(), *value));
        model.declare_values_in(&log.name(), values);
        model.configurations.push(Configuration {
            pattern: log.name(),
            given,
        });
        model
    }
}

/// The values per log that a fit has found of declared parameters.
pub(super) fn fitted(
    Named(parameters): &Named<ParameterTable<'_>>,
) -> Result<Vec<PerLogValue>, FileError> {
    let mut fitted = Vec::new();
    for (k, (_, table)) in parameters.iter().enumerate() {
        let Named(logs) = &table.logs;
        if table.per.is_none() && !logs.is_empty() {
            let message =
                "`logs` holds values per log; give `per = \"log\"` or `per = \"group\"` as well";
            return Err(table.section.error_at("logs", message));
        }
        fitted.extend(logs.iter().map(|(log, given)| of_one_log(log, given, k)));
    }
    Ok(fitted)
}
