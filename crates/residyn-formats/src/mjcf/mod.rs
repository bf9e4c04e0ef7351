//! MJCF, the format of MuJoCo: read, written and written into.

mod actuator;
mod classes;
mod equality;
mod geom;
mod orientation;
mod read;
mod rewrite;
mod write;

pub(super) use write::FORMAT;
