//! JSON with safetensors beside it.

mod description;
mod operations;

pub use description::{Description, ImportError, Imported};
pub(super) use description::{JSON, SAFETENSORS};
