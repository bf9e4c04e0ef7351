//! Dynamics models: the file format, the assembly of equations and effects into one program, and the
//! integrators that run it.

mod dynamics;

pub use dynamics::{Dynamics, Parameter};
