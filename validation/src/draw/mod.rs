//! Rigs drawn at random by the rules in a grid file: which effects they hide and how large, how messy their logs are,
//! and how far off their model files start.

mod matters;
mod recipe;
mod rules;
mod size;

pub use recipe::{Drawn, Recipe};
pub use rules::Rules;
