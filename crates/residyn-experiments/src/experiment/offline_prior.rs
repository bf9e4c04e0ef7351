//! Experiment 2: the prior is a network trained on a simulated plant without the friction of the real one.

use super::Session;
use crate::mbrl::Prior;

pub(super) const NAME: &str = "offline-prior";

pub(super) fn check(session: &Session) -> Result<(), String> {
    if session.has_prior(|prior| matches!(prior, Prior::Trained(_))) {
        return Ok(());
    }
    Err(format!(
        "{NAME} needs a method whose prior is a trained model; give it a `checkpoint`"
    ))
}
