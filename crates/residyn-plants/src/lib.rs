//! Plants in other processes: rigs and simulators of the user's own, driven over lines of JSON as docs/plants.md says.

mod address;
mod controlled;
mod description;
mod error;
mod fleet;
mod guard;
mod message;
mod recorder;
mod remote;
mod wire;

pub use address::{Address, AddressError, Reach};
pub use controlled::{Beginning, Controlled, ControlledError, Simulation, Unsuited, plant_seed};
pub use description::{Clock, Commanded, Description, Limits};
pub use error::RemoteError;
pub use fleet::Fleet;
pub use guard::Guard;
pub use remote::{Lateness, Remote};
