//! Stage 4: how commands reach the drives of a machine on position control, decided by the motion.
//!
//! The torques that a law asks for, low-passed, hardly tell a delay from a lag, and a search that took the wrong one makes up
//! with friction and rotors for what it leaves. So it is repeated with each of them alone, and the model stays that
//! predicts the motion under the commands best.

use rand::Rng;

use super::by_motion::{Comparison, estimate};
use super::error::StudyError;
use super::fit::Declared;
use super::limbs::Limb;
use super::problem::Problem;
use super::searched::Searched;
use super::stage::Watch;
use crate::data::{Joint, Log};
use crate::model::{AlikeOn, FittedEffect};

/// As [`Searched::by`], with the filter of commands that the motion asks for.
///
/// # Errors
/// As [`Problem::fit_declared`].
pub(super) fn searched<'a>(
    declared: Declared<'a>,
    apart: &[Log],
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Result<Searched<'a>, StudyError> {
    let mut best = Searched::by(declared.clone(), apart, rng, watch)?;
    if !declared.problem.is_by_law() || !is_in_doubt(&best) {
        return Ok(best);
    }
    let Declared { problem, fitted } = declared;
    let joints = Joint::all(problem.declared.joints).collect();
    let limb = Limb::of(&problem, &[], joints);
    let Some(mut least) = loss_of_motion(&problem, &limb, &best) else {
        return Ok(best);
    };
    for library in problem.library.of_one_filter() {
        if watch.has_to_end() {
            break;
        }
        let alone = Declared {
            problem: Problem {
                library,
                ..problem.clone()
            },
            fitted: fitted.clone(),
        };
        let mut other = Searched::by(alone, apart, rng, watch)?;
        other.declared.problem.library = problem.library;
        let enough = least * (1.0 - problem.settings.select.round_gain);
        let loss = loss_of_motion(&problem, &limb, &other);
        if let Some(loss) = loss.filter(|loss| *loss < enough) {
            (best, least) = (other, loss);
        }
    }
    Ok(best)
}

/// Whether commands were found to be filtered, but not as one bus to all drives does.
fn is_in_doubt(searched: &Searched<'_>) -> bool {
    let Declared { problem, .. } = &searched.declared;
    let model = &searched.chosen.after.model;
    let added = &model.effects[problem.added(model)];
    let filters: Vec<&FittedEffect> = added
        .iter()
        .filter(|added| added.effect.is_filter())
        .collect();
    let is_of_bus = |filter: &&FittedEffect| filter.effect.alike_on == AlikeOn::Commanded;
    let is_of_one_bus = filters.len() == problem.declared.joints && filters.iter().all(is_of_bus);
    !filters.is_empty() && !is_of_one_bus
}

/// The loss of the motion under the commands, after a short fit to it.
fn loss_of_motion(problem: &Problem<'_>, limb: &Limb, searched: &Searched<'_>) -> Option<f64> {
    let model = &searched.chosen.after.model;
    let trial = Comparison::of(problem, limb).short(model);
    estimate(&trial, model).ok().map(|fitted| fitted.loss())
}
