//! Logs, models, plants and runs as files. All code that opens files is here or in the binary; their meaning is in
//! `residyn-core`.

pub mod files;
mod guarded;
mod log_file;
mod log_folder;
mod log_values;
mod model_file;
mod plant_file;
pub mod runs;
mod table;

pub use guarded::guarded;
pub use log_file::{
    WriteLogError, read_log, read_log_from, read_logs, read_rig_log, read_standard_log,
    read_standard_log_from, write_log,
};
pub use log_folder::logs_in;
pub use log_values::with_values_of;
pub use model_file::{effect_files, read_effect, read_model, with_effects_in};
pub use plant_file::{plant_from_text, read_plant};
pub use table::{LOG_FORMATS, LogFormat};
