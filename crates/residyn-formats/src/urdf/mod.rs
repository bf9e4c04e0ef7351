//! URDF, the format of ROS: read, written and written into.

mod read;
mod rewrite;
mod write;

pub(super) use write::FORMAT;
