//! Closing the loop: from logs and a declared model to the effects that the model lacks.

mod bootstrap;
mod candidate;
mod folds;
mod learn;
mod outcome;
mod residual;
mod run;
mod select;
mod split;
mod study;
mod unexplained;

pub use learn::Learned;
pub use outcome::{Alternative, Errors, Finding, Outcome, Verdict};
pub use residual::{ForceSample, norm, residual_force};
pub use run::{Request, STAGES, Stage, close_loop};
pub use select::{Evidence, MOST_EFFECTS, Round, Selection, p_value, select};
pub use split::{How, Split};
pub use study::{Fitted, Study, StudyError, joined};
pub use unexplained::{SIGNIFICANT, Unexplained, unexplained};
