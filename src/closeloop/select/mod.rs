//! Stage 4: choose the set of effects that explains the logs best.

mod ahead;
mod blocks;
mod candidate;
mod evidence;
mod exchange;
mod folds;
mod losses;
mod outlook;
mod rivals;
mod search;
mod sets;
mod simpler;
#[cfg(test)]
mod tests;
mod trial;

pub(super) use self::blocks::usual_friction;
pub(super) use self::candidate::{acting, best_start, candidates, is_of_too_many, promise, starts};
pub(super) use self::evidence::{gain, p_of_gains, p_value};
pub(super) use self::folds::{Folds, left_out_losses};
pub(super) use self::losses::Losses;
pub use self::rivals::Rival;
pub(super) use self::search::Search;
pub use self::search::{Round, Tried};
pub(super) use self::trial::Trial;
