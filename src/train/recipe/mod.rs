//! Recipes: text files that say what to train on which data; and the jobs made from them, which can be interrupted and
//! resumed.

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
