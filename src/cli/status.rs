//! Exit status of errors.

use std::error::Error;

use residyn_control::control::{EpisodeError, LostPlan};
use residyn_core::identify::FitError;
use residyn_core::plant::PlantError;
use residyn_train::TrainError;

/// A result of a command that is not finite.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct NotFinite(pub String);

/// 1 if the program ran until its numbers ceased to be finite, 2 if it could not run.
pub(super) fn status(error: &anyhow::Error) -> u8 {
    match error.chain().any(is_divergence) {
        true => 1,
        false => 2,
    }
}

fn is_divergence(error: &(dyn Error + 'static)) -> bool {
    let of_fit = matches!(error.downcast_ref(), Some(FitError::Diverged { .. }));
    let of_plant = matches!(
        error.downcast_ref(),
        Some(PlantError::Diverged { .. } | PlantError::Mass { .. })
    );
    let of_episode = matches!(error.downcast_ref(), Some(EpisodeError::Formula { .. }));
    let of_training = matches!(error.downcast_ref(), Some(TrainError::Diverged { .. }));
    let of_command = error.is::<NotFinite>();
    let of_plan = error.is::<LostPlan>();
    of_command || of_fit || of_plant || of_episode || of_plan || of_training
}
