//! Plants in other processes: rigs and simulators of the user's own, driven over lines of JSON as docs/plants.md says.

mod address;
mod description;
mod error;
mod guard;
mod message;
mod recorder;
mod remote;
mod wire;

pub use address::{Address, AddressError};
pub use description::{Clock, Commanded, Description, Limits};
pub use error::RemoteError;
pub use remote::{Lateness, Remote};
