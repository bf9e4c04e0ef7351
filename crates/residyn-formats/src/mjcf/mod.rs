//! MJCF, the format of MuJoCo: reading, writing, and writing values into existing files.

mod actuator;
mod classes;
mod drive;
mod equality;
mod geom;
mod orientation;
mod read;
mod rewrite;
mod transmission;
mod write;

pub(super) use write::FORMAT;
