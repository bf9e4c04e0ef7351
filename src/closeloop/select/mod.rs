//! Stage 4: choose the effects that the logs support.

mod candidate;
mod evidence;
mod folds;
mod search;
mod simpler;

pub(super) use self::candidate::{acting, best_start, candidates, starts};
pub use self::evidence::{Evidence, p_value};
pub(super) use self::evidence::{PLAIN, WORTHWHILE, gain, p_of_gains};
pub(super) use self::folds::{folds, left_out_losses};
pub(super) use self::search::{FALSE_ALARM, SIGNIFICANT_ALONE, Search};
pub use self::search::{MOST_EFFECTS, Rival, Round};
