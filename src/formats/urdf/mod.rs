//! URDF, the format of ROS: read and written.

mod read;
mod write;

pub(super) use write::FORMAT;
