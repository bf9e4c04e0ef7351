//! URDF, the format of ROS: read and written.

mod read;
mod write;

pub use read::read_urdf;
pub(super) use write::FORMAT;
