//! Measured rigs: how closing the loop compares with a plain structure and with published parameter sets on logs left
//! out of the fit.

mod config;
mod errors;
mod fold;
mod markdown;
mod method;
mod table;

pub use config::{Declared, Published, Rig, RigsError, Test, read};
pub use errors::{LogErrors, Squares};
pub use fold::{Fold, Measured, Place};
pub use markdown::markdown;
pub use method::{Found, Method, Said, Scored, Tools};
pub use table::{Entry, Horizon, Line, Row, Summary, summarise};
