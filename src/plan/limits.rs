//! Checks of settings, with messages that name the key, its value and what it may be.

use std::fmt::Display;
use std::ops::RangeBounds;

/// Refuse an elite that is none of the population.
pub(super) fn check_elite(elite: usize, population: usize) -> Result<(), String> {
    let remedy = format!("a whole number from 1 to {population}, the population");
    within("elite", elite, 1..=population, &remedy)
}

/// Refuse a count that is zero or above `most`.
pub(super) fn whole(key: &str, value: usize, most: usize) -> Result<(), String> {
    within(
        key,
        value,
        1..=most,
        &format!("a whole number from 1 to {most}"),
    )
}

/// Refuse the value of `key` outside of `range`, which `remedy` puts into words.
pub(super) fn within<T: PartialOrd + Display>(
    key: &str,
    value: T,
    range: impl RangeBounds<T>,
    remedy: &str,
) -> Result<(), String> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(format!("`{key}` is {value}; it must be {remedy}"))
}
