//! Stage 4: choose the effects that the logs support.

mod candidate;
mod evidence;
mod folds;
mod search;
mod simpler;

pub(super) use self::candidate::{acting, best_start, candidates, starts};
pub use self::evidence::Evidence;
pub(super) use self::evidence::{gain, p_of_gains, p_value};
pub(super) use self::folds::left_out_losses;
pub(super) use self::search::Search;
pub use self::search::{Rival, Round};
