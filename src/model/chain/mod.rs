//! Model files from robot descriptions: a serial mechanism is read from URDF or MJCF, and its equations of motion are
//! derived in closed form.
//!
//! A reader makes a tree of bodies of a file; lumping what is welded makes a [`Chain`] of it. Each entry of the
//! mass matrix is linear in the physical parameters, with Fourier series in the angles as coefficients, which
//! is a form in which equal functions look the same: so parameters that the motion shows only in combinations are
//! found and put together.

mod base;
mod body;
mod equations;
mod formula;
mod model_file;
mod recover;
mod series;
mod spatial;

pub use body::{Chain, Drivetrain, Joint, Spring};
pub(crate) use equations::without_inertia;
pub use model_file::model_text;
pub use recover::{Recovered, recover};
pub use series::MOST_JOINTS;
pub(crate) use series::rounded;
pub use spatial::{Inertia, Pose};
pub(crate) use spatial::{fault, turn, with_z_along};
