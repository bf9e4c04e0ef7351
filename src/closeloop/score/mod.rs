//! Stage 9: measure every model on the test logs.

mod bootstrap;
mod contradicted;
mod contribution;
mod errors;

pub use self::contradicted::Contradicted;
pub(super) use self::contradicted::contradicted;
pub use self::contribution::Finding;
pub(super) use self::contribution::findings;
pub(super) use self::errors::Scorer;
pub use self::errors::{Errors, TorqueErrors};
