//! Stage 4: limits of drives' torques, decided by the motion.
//!
//! Of a torque that the law asks for beyond a limit, the logs say no more than that it is beyond: a limit that is low enough,
//! with bodies that are light enough, fits the torques of any log. No such machine would move like the rig. So where a search
//! finds limits, a second one looks for none, and the motion under the commands is asked which it fits better.

use rand::Rng;

use super::command_path::loss_of_motion;
use super::error::StudyError;
use super::fit::Declared;
use super::problem::Problem;
use super::searched::Searched;
use super::stage::Watch;
use crate::data::Log;

/// As [`Searched::by`], with limits only if the motion asks for them.
///
/// # Errors
/// As [`Problem::fit_declared`].
pub(super) fn searched<'a>(
    declared: Declared<'a>,
    apart: &[Log],
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Result<Searched<'a>, StudyError> {
    let limited = Searched::by(declared.clone(), apart, rng, watch)?;
    if !limited.declared.problem.is_by_law() || !limited.has_limits() {
        return Ok(limited);
    }
    let problem = Problem {
        library: declared.problem.library.without_limits(),
        ..declared.problem
    };
    let free = Searched::by(
        Declared {
            problem,
            ..declared
        },
        apart,
        rng,
        watch,
    )?;
    let loss = |searched: &Searched<'_>| {
        loss_of_motion(&limited.declared.problem, &searched.chosen.after.model)
    };
    let enough = 1.0 - limited.declared.problem.settings.select.round_gain;
    let is_better = loss(&limited)
        .zip(loss(&free))
        .is_some_and(|(with, without)| with < without * enough);
    Ok(if is_better { limited } else { free })
}

impl Searched<'_> {
    /// Whether it found a limit.
    fn has_limits(&self) -> bool {
        let model = &self.chosen.after.model;
        let mut added = model.effects[self.declared.problem.added(model)].iter();
        added.any(|added| added.effect.limits_command())
    }
}
