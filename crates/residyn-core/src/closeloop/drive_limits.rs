//! Stage 4: limits of drives' torques, decided by the motion.
//!
//! Of a torque that the law asks for beyond a limit, the logs say no more than that it is beyond: a limit that is low enough,
//! with bodies that are light enough, fits the torques of any log. No such machine would move like the rig. So limits that a
//! search finds stay only if the model moves better with them than without, and than one with what most machines have; if
//! not, a second search looks for none.

use rand::Rng;

use super::by_motion::loss_of_motion;
use super::error::StudyError;
use super::fit::Declared;
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
    let is_sure = !limited.declared.problem.is_by_law() || !limited.has_limits();
    if is_sure || limited.moves_by_its_limits() {
        return Ok(limited);
    }
    let mut without = declared;
    without.problem.library = without.problem.library.without_limits();
    Searched::by(without, apart, rng, watch)
}

impl Searched<'_> {
    fn has_limits(&self) -> bool {
        let mut added = self.added().iter();
        added.any(|added| added.effect.limits_command())
    }

    /// Whether the motion is fitted better with the limits than without them, and than with what most machines have.
    fn moves_by_its_limits(&self) -> bool {
        let (problem, model) = (&self.declared.problem, &self.chosen.after.model);
        let mut without = self.added().to_vec();
        without.retain(|added| !added.effect.limits_command());
        let without = [&problem.declared.effects, without.as_slice()].concat();
        let without = model.with_effects(without);
        let usual = self.chosen.usual.as_ref().map(|usual| &usual.model);
        let Some(loss) = loss_of_motion(problem, model) else {
            return false;
        };
        let enough = loss / (1.0 - problem.settings.select.round_gain);
        let mut others = usual.into_iter().chain([&without]);
        others.all(|other| loss_of_motion(problem, other).is_none_or(|other| other > enough))
    }
}
