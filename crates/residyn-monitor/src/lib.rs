//! A watch on a running machine: its rows go in as they come, and alarms come out that say what has changed against the
//! model, and since when. docs/monitor.md has the method.

mod alarm;
mod averages;
mod baseline;
mod block;
mod equations;
mod error;
mod grid;
mod history;
mod hypothesis;
mod judgement;
mod kernel;
mod monitor;
mod rows;
mod settings;
mod summary;
mod tails;

pub use alarm::{Alarm, Estimate, Kind, Named};
pub use error::MonitorError;
pub use monitor::Monitor;
pub use rows::Rows;
pub use settings::Settings;
pub use summary::{DetectionLimit, Summary};

#[cfg(test)]
mod tests;
