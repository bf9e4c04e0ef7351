//! Experiment 1: the prior is the declared physics, which lacks the friction of the plant.

use super::Session;
use crate::mbrl::Prior;

pub(super) const NAME: &str = "physics-prior";

pub(super) fn check(session: &Session) -> Result<(), String> {
    let physics = |prior: &Prior| matches!(prior, Prior::Equations(_));
    if session
        .methods
        .iter()
        .any(|method| physics(&method.learner.prior))
    {
        return Ok(());
    }
    Err(format!(
        "{NAME} needs a method whose prior is equations; give it a `model`"
    ))
}
