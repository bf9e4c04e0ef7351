//! Measured rigs: how closing the loop compares with a plain structure, published parameter sets and mujoco.sysid on logs
//! left out of the fit.

mod config;
mod errors;
mod fold;
mod markdown;
mod method;
mod mujoco;
mod picture;
mod table;

pub use config::{Declared, Published, Rig, RigsError, Test, read};
pub use errors::{LogErrors, Squares, errors_on};
pub use fold::{Fold, Measured, Place};
pub use markdown::markdown;
pub use method::{Found, Method, Said, Scored, Tools};
pub use mujoco::Task;
pub use picture::picture;
pub use table::{Compared, Entry, Horizon, Line, Row, Simpler, Summary, summarise};
