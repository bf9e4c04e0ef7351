//! The mechanics of a tree of bodies on a fixed base: from a [`Tree`] to a model file ([`model_text`]), and back for a
//! few kinds of mechanism (`recover`).
//!
//! A tree of many joints is written as its bodies; its equations are then written as operations ([`Links`]). A short one is
//! written in closed form: each entry of the mass matrix is linear in the physical parameters, with Fourier series in
//! the angles as coefficients. In this form equal functions look the same, so that parameters which the motion
//! determines only in combination are found and lumped (base parameters).

mod base;
mod bodies_text;
mod body;
mod closed_form;
mod equations;
mod formula;
mod model_file;
mod nearest;
mod pseudo_inertia;
pub mod recover;
mod recursive;
mod series;
mod spatial;
mod values;
mod weightless;

pub use body::{Drivetrain, Follows, Joint, Servo, Spring, Tree};
pub use model_file::model_text;
pub(crate) use pseudo_inertia::{Divergence, physical_parts};
pub use recover::{Recovered, recover};
pub use recursive::{Body, Links, Place};
pub use series::rounded;
pub(crate) use spatial::PARTS;
pub use spatial::{Inertia, Pose};
pub use spatial::{fault, turn, with_z_along};
pub use values::{ValuesError, added};
pub use weightless::without_inertia;
