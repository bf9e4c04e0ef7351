//! Stage 4: choose the set of effects that explains the logs best.

mod baseline;
mod candidate;
mod equations;
mod evidence;
mod exchange;
mod folds;
mod helpful;
mod identity;
mod knowledge;
mod losses;
mod on_sample;
mod open_loop_check;
mod rivals;
mod scale;
mod screen;
mod screening;
mod search;
mod sets;
mod simpler;
#[cfg(test)]
mod tests;
mod trial;

pub(super) use self::baseline::{baseline_friction, forces_and_rotors, usual_forces};
pub use self::candidate::candidates;
pub(super) use self::candidate::{acting, best_start, is_of_too_many, screened_cost, starts};
pub(super) use self::evidence::{f_test, gain, p_of_gains, p_value, p_value_by};
pub(super) use self::folds::{Folds, left_out_losses};
pub(super) use self::losses::Losses;
pub(super) use self::open_loop_check::is_worse;
pub use self::rivals::Rival;
pub(super) use self::rivals::rivals;
pub(super) use self::scale::gains_relative_to;
pub use self::screen::screen;
pub use self::search::{Round, Selected, Tried, select};
pub(super) use self::search::{select_beginning_with, select_from};
pub(super) use self::simpler::{parts, simpler};
pub(super) use self::trial::{Trial, is_consistent};
