//! What closing the loop found, for people and for programs.

mod accuracy;
mod bodies;
mod calibration;
mod film;
mod folder;
mod json;
mod model_file;
mod picture;
pub mod plot;
mod remainder;
mod schema;
mod summary;
mod tensorboard;
mod text;
mod wording;

pub use film::film;
pub use folder::{WriteError, write};
pub use model_file::model_file;
pub use schema::{Report, schema};
pub use summary::summary;
pub use tensorboard::EventFile;
pub use text::text;
pub(crate) use wording::digits;
