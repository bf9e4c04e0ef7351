//! Closing the loop: from logs and a declared model to the effects that the model lacks.

mod bootstrap;
mod calibrate;
mod candidate;
mod confirm;
mod contradicted;
mod evidence;
mod experiment;
mod find;
mod folds;
mod learn;
mod outcome;
mod per_log;
mod residual;
mod run;
mod search;
mod simpler;
mod split;
mod study;
mod unexplained;

pub use calibrate::{Calibration, HIDDEN, Limit, Size, Step, calibrate};
pub use confirm::TakenBack;
pub use contradicted::Contradicted;
pub use evidence::{Evidence, p_value};
pub use experiment::Separation;
pub use find::{Found, find};
pub use learn::Learned;
pub use outcome::{Alternative, Contender, Errors, Finding, Outcome, Verdict};
pub use per_log::values_on;
pub use residual::{ForceSample, norm, residual_force};
pub use run::{Request, STAGES, Stage, close_loop};
pub use search::{MOST_EFFECTS, Rival, Round, Search};
pub use split::{How, Split};
pub use study::{Fitted, Study, StudyError, joined};
pub use unexplained::{SIGNIFICANT, Unexplained, unexplained};
