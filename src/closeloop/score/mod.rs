//! Stage 9: measure every model on the test logs.

mod bootstrap;
mod contradicted;
mod contribution;
mod errors;
mod test_log;

pub use self::contradicted::Contradicted;
pub(super) use self::contradicted::contradicted;
pub use self::contribution::Finding;
pub(super) use self::contribution::findings;
pub use self::errors::{Errors, TorqueErrors};
pub(super) use self::errors::{Scored, Scorer};
pub use self::test_log::TestLog;
