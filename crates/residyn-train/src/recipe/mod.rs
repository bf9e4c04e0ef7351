//! Recipes: text files that say what to train on which data; and the jobs made from them, which can be interrupted and
//! resumed.

mod data;
mod error;
mod file;
mod job;
mod results;
mod saves;
mod sweep;
mod sweep_results;
mod training_data;
mod tune;

pub use data::{Data, Logged, Simulated};
pub use error::RecipeError;
pub use file::{Kind, Recipe};
pub use job::Job;
pub use results::{Change, FittedParameter, TrainingResults};
pub use saves::Saves;
pub use sweep::Member;
pub use sweep_results::{Quartiles, SweepResults, SweptModel, Totals};
pub use training_data::TrainingData;
