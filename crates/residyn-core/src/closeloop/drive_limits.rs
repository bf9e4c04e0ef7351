//! Stage 4: limits of drives' torques, decided by the motion.
//!
//! Of a torque that the law asks for beyond a limit, the logs say no more than that it is beyond: a limit that is low enough,
//! with bodies that are light enough, fits the torques of any log. No such machine would move like the rig. So limits that a
//! search finds stay only if the joints that have them move better than with what a search finds that looks for none.

use rand::Rng;

use super::by_motion::{log_ratio, squares_of_motion};
use super::error::StudyError;
use super::fit::Declared;
use super::scaled_bodies;
use super::searched::Searched;
use super::stage::Watch;
use crate::data::{Joint, Log};

/// As [`scaled_bodies::searched`], with limits only if the motion asks for them.
///
/// # Errors
/// As [`Problem::fit_declared`].
pub(super) fn searched<'a>(
    declared: Declared<'a>,
    apart: &[Log],
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Result<Searched<'a>, StudyError> {
    let limited = scaled_bodies::searched(declared.clone(), apart, rng, watch)?;
    let joints = limited.limited_joints();
    if joints.is_empty() || !limited.declared.problem.is_by_law() {
        return Ok(limited);
    }
    let unlimited = declared.problem.library.without_limits();
    let without = scaled_bodies::searched(declared.with_library(unlimited), apart, rng, watch)?;
    Ok(match limited.moves_better_than(&without, &joints) {
        true => limited,
        false => without,
    })
}

impl Searched<'_> {
    fn limited_joints(&self) -> Vec<Joint> {
        let added = self.added().iter();
        let limits = added.filter(|added| added.effect.limits_command());
        limits.map(|limit| limit.joint).collect()
    }

    /// Whether these joints move more like the logged ones than those that another search found.
    fn moves_better_than(&self, other: &Self, joints: &[Joint]) -> bool {
        let problem = &self.declared.problem;
        let squares = |searched: &Self| {
            let squares = squares_of_motion(problem, &searched.chosen.after.model)?;
            Some(Vec::from_iter(joints.iter().map(|joint| squares[*joint])))
        };
        let enough = (1.0 - problem.settings.select.round_gain).ln();
        let Some(own) = squares(self) else {
            return false;
        };
        squares(other).is_none_or(|other| log_ratio(&own, &other) < enough)
    }
}
