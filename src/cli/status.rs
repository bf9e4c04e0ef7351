//! Exit status of errors.

use std::error::Error;

use crate::identify::FitError;
use crate::plant::PlantError;
use crate::train::TrainError;

/// 1 where the program ran until its numbers ceased to be finite, 2 where it could not run.
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
    let of_training = matches!(error.downcast_ref(), Some(TrainError::Diverged { .. }));
    of_fit || of_plant || of_training
}
