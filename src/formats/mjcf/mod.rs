//! MJCF, the format of MuJoCo: read and written.

mod actuator;
mod classes;
mod equality;
mod geom;
mod orientation;
mod read;
mod write;

pub(super) use write::FORMAT;
