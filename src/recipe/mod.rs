//! Recipes: what to train on what data, in a text file; and the jobs that come of them, which can be
//! interrupted and go on.

mod data;
mod error;
mod file;
mod job;
mod material;
mod outcome;
mod sweep;
mod swept;
mod tune;

pub use data::{Data, Logged, Simulated};
pub use error::RecipeError;
pub use file::{Kind, Recipe};
pub use job::Job;
pub use material::Material;
pub use outcome::{Change, Learnt, Outcome};
pub use sweep::Member;
pub use swept::{Model, Quartiles, Swept, Totals};
