//! URDF, the format of ROS: reading, writing, and writing values into existing files.

mod read;
mod rewrite;
mod write;

pub(super) use write::FORMAT;
