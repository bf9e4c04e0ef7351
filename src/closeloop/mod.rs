//! Closing the loop: from logs and a declared model to the effects that the model lacks.

mod candidate;
mod folds;
mod residual;
mod select;
mod study;
mod unexplained;

pub use residual::{ForceSample, norm, residual_force};
pub use select::{Evidence, Round, Selection, p_value, select};
pub use study::{Fitted, Study, StudyError, WINDOWS_S, joined};
pub use unexplained::{SIGNIFICANT, Unexplained, unexplained};
