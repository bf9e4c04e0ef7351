//! Reports of what closing the loop found, for people and for programs.

mod by_log;
mod calibration;
mod document;
mod effect_curve;
mod folder;
mod headline;
mod json;
mod lengths;
mod model_file;
mod motion;
mod overview;
mod page;
mod picture;
mod plot_data;
mod schema;
mod summary;
mod text;
mod wording;

pub use folder::{ReadError, WriteError, write};
pub use model_file::model_file;
pub use page::{ResultsPage, page};
pub use schema::{Report, schema};
pub use summary::{Words, answer, curves, summary};
pub use text::text;
