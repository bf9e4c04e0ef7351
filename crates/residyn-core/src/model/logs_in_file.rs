//! The tables `[logs."pattern"]` of a model file, and the values per log of its parameters.

use super::Parameter;
use super::configuration::Configuration;
use super::dynamics::PerLogValue;
use super::effects_in_file::of_one_log;
use super::reader::{FileError, Section};
use super::tables::ParameterTable;
use super::values::Named;

/// The tables, in the order of the file.
pub(super) fn configurations(
    Named(tables): Named<Section<'_>>,
    parameters: &[Parameter],
) -> Result<Vec<Configuration>, FileError> {
    let names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
    let table = |(pattern, section): (String, Section<'_>)| {
        section.only(&names)?;
        let mut given = Vec::new();
        for (k, parameter) in parameters.iter().enumerate() {
            if let Some(value) = section.read(&parameter.name)? {
                check_value(&section, parameter, value)?;
                given.push((k, value));
            }
        }
        Ok(Configuration { pattern, given })
    };
    tables.into_iter().map(table).collect()
}

/// Refuse a value that a table cannot give.
fn check_value(section: &Section<'_>, parameter: &Parameter, value: f64) -> Result<(), FileError> {
    let (name, [low, high]) = (&parameter.name, parameter.bounds);
    let fault = if parameter.per_log {
        "is fitted for each log or group, as its `per` says; remove that or this value".to_owned()
    } else if (low..=high).contains(&value) {
        return Ok(());
    } else {
        format!("is {value}, outside its bounds {low} to {high}")
    };
    Err(section.error_at(name, format!("`{name}` {fault}")))
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
