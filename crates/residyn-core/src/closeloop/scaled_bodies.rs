//! Stage 4: gains of drives with which bodies have come out larger or smaller by the same factor.
//!
//! A drive with another gain moves a body of another mass, with another friction, in the same way. What is declared of bodies
//! holds their scale, but not against all that a model lacks: a small gain of light bodies may stand for a friction. If
//! nothing tells the gains that a search finds from bodies, a second search looks for none.

use std::ops::RangeInclusive;

use rand::Rng;

use super::drive_gain::FEWEST;
use super::error::StudyError;
use super::fit::Declared;
use super::judge::holds_zero;
use super::problem::Problem;
use super::refine::with_intervals;
use super::score::{Contradicted, contradicted};
use super::searched::Searched;
use super::stage::Watch;
use crate::data::Log;
use crate::identify::uncertainty;
use crate::model::Model;

/// Two factors are about the same if the ratio of their logarithms is within these.
const SAME_FACTOR: RangeInclusive<f64> = 0.5..=2.0;

/// As [`Searched::by`], without gains if none of those that are found is told from the bodies.
///
/// # Errors
/// As [`Problem::fit_declared`].
pub(super) fn searched<'a>(
    declared: Declared<'a>,
    apart: &[Log],
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Result<Searched<'a>, StudyError> {
    let found = Searched::by(declared.clone(), apart, rng, watch)?.at_likelier_scale(watch);
    if !found.has_gains_of_bodies() {
        return Ok(found);
    }
    let without_gains = declared.problem.library.without_gains();
    Searched::by(declared.with_library(without_gains), apart, rng, watch)
}

impl Searched<'_> {
    /// Whether gains were found, and none is told from the bodies: its interval holds zero, or its body follows it, or that
    /// of a gain of about the same factor. The body of a joint on the base may show little of its own.
    fn has_gains_of_bodies(&self) -> bool {
        let (problem, after) = (&self.declared.problem, &self.chosen.after);
        let is_gain = |k: &usize| after.model.effects[*k].effect.is_gain();
        let gains: Vec<usize> = problem.added(&after.model).filter(is_gain).collect();
        if gains.is_empty() || !problem.is_by_law() {
            return false;
        }
        let known = uncertainty(&problem.shooting, &after.fit);
        let model = with_intervals(problem, after, &known, &after.model);
        let there = gains
            .into_iter()
            .filter(|k| !holds_zero(&model.effects[*k]));
        let factors: Vec<(f64, usize)> = there
            .filter_map(|k| {
                let scaled = scaled_by(problem, &model, k).len();
                Some((model.effects[k].gain()?, scaled))
            })
            .collect();
        let is_scaled = |(own, _): &(f64, usize)| {
            let mut with_bodies = factors.iter().filter(|(_, scaled)| *scaled > 0);
            with_bodies.any(|(other, _)| is_same_factor(*own, *other))
        };
        let scaled: usize = factors.iter().map(|(_, scaled)| scaled).sum();
        factors.is_empty() || factors.iter().all(is_scaled) && scaled >= FEWEST
    }
}

/// Why the k-th effect of a fitted model, if it is a gain, is not established: nothing tells it from the body of its joint.
pub(super) fn scaled_bodies(problem: &Problem<'_>, fitted: &Model, k: usize) -> Option<String> {
    let names = scaled_by(problem, fitted, k);
    (names.len() >= FEWEST).then(|| {
        let names = names.join(", ");
        format!("{names} are scaled by about the same factor, and nothing tells which of them is")
    })
}

/// The values of its joint's body that are off their declaration by about the factor of a gain, the k-th effect of a fitted
/// model; none of another effect. A known load tells the two apart.
fn scaled_by(problem: &Problem<'_>, fitted: &Model, k: usize) -> Vec<String> {
    let own = &fitted.effects[k];
    let mut logs = problem.logs.iter();
    let is_told = !problem.is_by_law() || logs.any(|log| problem.declared.has_known_load(log));
    let Some(gain) = own.gain().filter(|_| !is_told) else {
        return Vec::new();
    };
    let bodies = problem.declared.inertias();
    let Some(body) = bodies.get(own.joint.index()) else {
        return Vec::new();
    };
    let declared = &problem.declared.parameters;
    let is_of_body = |off: &Contradicted| {
        let mut body = body.iter().map(|part| &declared[*part].name);
        body.any(|name| *name == off.fitted.name)
    };
    let off = contradicted(declared, &fitted.absorbed().parameters);
    let scaled = off
        .into_iter()
        .filter(|off| is_of_body(off) && is_scaled_by(gain, off));
    scaled.map(|off| off.fitted.name).collect()
}

/// Whether a value is off its declaration by about this factor.
fn is_scaled_by(gain: f64, off: &Contradicted) -> bool {
    is_same_factor(gain, off.fitted.value / off.declared)
}

fn is_same_factor(gain: f64, other: f64) -> bool {
    SAME_FACTOR.contains(&(other.ln() / gain.ln()))
}

#[cfg(test)]
mod tests {
    use super::is_scaled_by;
    use crate::closeloop::score::Contradicted;
    use crate::model::Library;

    #[test]
    fn a_body_that_is_lighter_by_a_gain_is_scaled_by_it() {
        let fitted = Library::built_in().model("acrobot").unwrap().parameters[0].clone();
        let value = fitted.value;
        let is_scaled = |gain: f64, factor: f64| {
            let (declared, fitted) = (value / factor, fitted.clone());
            is_scaled_by(gain, &Contradicted { declared, fitted })
        };
        assert!(is_scaled(0.3, 0.3) && is_scaled(0.3, 0.2) && is_scaled(1.4, 1.5));
        assert!(!is_scaled(0.3, 0.9) && !is_scaled(0.3, 3.0) && !is_scaled(1.4, 0.7));
        assert!(
            !is_scaled(0.3, -0.3),
            "a value of the other sign is not scaled"
        );
    }
}
