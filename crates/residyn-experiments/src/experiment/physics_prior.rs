//! Experiment 1: the prior is the declared physics, without the friction of the plant.

use super::Session;
use crate::mbrl::Prior;

pub(super) const NAME: &str = "physics-prior";

pub(super) fn check(session: &Session) -> Result<(), String> {
    if session.has_prior(|prior| matches!(prior, Prior::Equations(_))) {
        return Ok(());
    }
    Err(format!(
        "{NAME} needs a method whose prior is equations; give it a `model`"
    ))
}
