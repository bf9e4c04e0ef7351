//! Shared by the robot description formats: XML elements, the tree of bodies, and the mechanism with a model's
//! equations.

pub(super) mod edit;
pub(super) mod element;
pub(super) mod mechanism;
mod servo;
pub(super) mod tree;
pub(super) mod write_back;
