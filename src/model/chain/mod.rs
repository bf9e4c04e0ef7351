//! The mechanics of a serial chain of bodies: from a [`Chain`] to equations of motion in closed form ([`model_text`]), and
//! back for a few kinds of mechanism (`recover`).
//!
//! Each entry of the mass matrix is linear in the physical parameters, with Fourier series in the angles as
//! coefficients. In this form equal functions look the same, so that parameters which the motion determines only in
//! combination are found and lumped (base parameters).

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
pub(crate) use recover::recover;
pub use series::MOST_JOINTS;
pub(crate) use series::rounded;
pub use spatial::{Inertia, Pose};
pub(crate) use spatial::{fault, turn, with_z_along};
