//! Residyn: from a rig's log to the physical effect that its model lacks.
pub mod cli;
pub mod closeloop;
pub mod data;
pub mod evaluate;
pub mod expr;
pub mod identify;
pub mod model;
pub mod plant;
pub mod recipe;
pub mod report;
pub mod train;
