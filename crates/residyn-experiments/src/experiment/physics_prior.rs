//! Experiment 1: the prior is the declared physics, without the friction of the plant.

use super::{Experiment, Session};
use crate::mbrl::Prior;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "physics-prior",
    check,
    horizons: |_| None,
};

fn check(session: &Session) -> Result<(), String> {
    let has_it = session.has_prior(|prior| matches!(prior, Prior::Equations(_)));
    let lacks = "physics-prior needs a method whose prior is equations; give it a `model`";
    has_it.then_some(()).ok_or(lacks.to_owned())
}
