//! Residyn: from a rig's log to the physical effect that its model lacks.
pub mod data;
pub mod expr;
pub mod model;
