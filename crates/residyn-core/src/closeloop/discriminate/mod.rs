//! Stage 6: the experiment that tells apart two explanations that the logs do not.

mod alternative;
mod comparison;
mod menu;
mod motion;
mod payload;
mod separation;

pub use self::alternative::{Alternative, NotSimulated, discriminate};
pub use self::separation::Separation;
