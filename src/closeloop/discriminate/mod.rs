//! Stage 6: the experiment that tells apart two explanations that the logs do not.

mod alternative;
mod comparison;
mod menu;
mod motion;
mod payload;
mod separation;

pub(super) use self::alternative::discriminate;
pub use self::alternative::{Alternative, NotSimulated};
pub use self::separation::Separation;
