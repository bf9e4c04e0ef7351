//! Experiment 2: the prior is a network trained on a simulated plant without the friction of the real one.

use super::{Experiment, Session};
use crate::mbrl::Prior;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "offline-prior",
    check,
    horizons: |_| None,
};

fn check(session: &Session) -> Result<(), String> {
    let has_it = session.has_prior(|prior| matches!(prior, Prior::Trained(_)));
    let lacks =
        "offline-prior needs a method whose prior is a trained model; give it a `checkpoint`";
    has_it.then_some(()).ok_or(lacks.to_owned())
}
