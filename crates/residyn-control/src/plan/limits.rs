//! Checks of settings, with messages that name the key, its value and the allowed values.

use std::fmt::Display;
use std::ops::RangeBounds;

use thiserror::Error;

/// A setting of a planner with which no search can run.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("`{key}` is {value}; it must be {remedy}")]
pub struct SettingsError {
    /// Its name in files.
    pub key: &'static str,
    pub value: String,
    /// What it may be.
    pub remedy: String,
}

/// Refuse an elite that is empty or larger than the population.
pub(super) fn check_elite(elite: usize, population: usize) -> Result<(), SettingsError> {
    let remedy = format!("a whole number from 1 to {population}, the population");
    within("elite", elite, 1..=population, &remedy)
}

/// Refuse a count that is zero or above `most`.
pub(super) fn whole(key: &'static str, value: usize, most: usize) -> Result<(), SettingsError> {
    let remedy = format!("a whole number from 1 to {most}");
    within(key, value, 1..=most, &remedy)
}

/// Refuse the value of `key` outside of `range`, which `remedy` puts into words.
pub(super) fn within<T: PartialOrd + Display>(
    key: &'static str,
    value: T,
    range: impl RangeBounds<T>,
    remedy: &str,
) -> Result<(), SettingsError> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(SettingsError {
        key,
        value: value.to_string(),
        remedy: remedy.to_owned(),
    })
}
