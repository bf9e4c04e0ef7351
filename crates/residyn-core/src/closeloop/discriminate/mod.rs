//! Stage 6: the experiment that distinguishes two explanations between which the logs cannot decide.

mod alternative;
mod comparison;
mod menu;
mod motion;
mod payload;
mod separation;

pub use self::alternative::{Alternative, NotSimulated, discriminate};
pub use self::separation::Separation;
