//! Residyn: from a rig's log to the physical effect that its model lacks.
//!
//! A model is a file: its equations are parsed once into one small program ([`expr::Program`]), and
//! everything else reads that program. [`closeloop`] fits a declared model to logs and names the effects
//! that it lacks; [`sim::metric`] measures how far a model runs from logs; [`plant`] simulates rigs with effects
//! that nobody is told about; [`train`] trains hybrid models of physics and a network; [`plan`] finds inputs by which a
//! model does what is wanted; [`formats`] reads and writes those of other programs. The binary
//! `residyn` is a thin layer over these modules.
//!
//! The library prints nothing outside of [`cli`], reads no clock, and takes its random numbers as an argument.
//!
//! # Example
//!
//! Find what a model lacks, predict a log with it, and write the report:
//!
//! ```
//! use residyn::{Library, Origin, Request, close_loop, report, rng};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # std::env::set_current_dir(&folder)?;
//! # let mut rig = residyn::plant::Plant::read("pendulum".as_ref(), &Library::built_in())?;
//! # let (joint, friction) = (residyn::data::Joint::at(0), [("F_c".to_owned(), 0.2)]);
//! # rig.add_effect(&Library::built_in(), "coulomb_friction", joint, &friction)?;
//! # for k in 1..=4 {
//! #     rig.record(&mut rng(k))?.write(format!("run{k}.csv"))?;
//! # }
//! let library = Library::built_in();
//! let model = library.model("pendulum")?; // or the path of a model file
//! let logs = model.read_logs(["run1.csv", "run2.csv", "run3.csv"])?;
//! let outcome = close_loop(Request::of(&model, &library, logs), &mut rng(0), &())?;
//! for effect in &outcome.effects.findings {
//!     println!("{effect}"); // name, joint, parameters with 95 % intervals
//! }
//! let predicted = outcome.models.after.predict(&model.read_log("run4.csv")?, 0.5);
//! report::write("report", &outcome, &Origin::of_seed(0))?;
//! # println!("{} predictions", predicted.len());
//! # assert_eq!(outcome.effects.findings.len(), 1);
//! # assert!(outcome.effects.findings[0].to_string().starts_with("coulomb_friction on joint 1: F_c1 = 0."));
//! # assert!(predicted.len() > 10 && std::path::Path::new("report/report.md").is_file());
//! # Ok(())
//! # }
//! ```

pub mod bench;
#[cfg(feature = "cli")]
pub mod cli;
pub mod closeloop;
pub mod control;
pub mod data;
#[cfg(feature = "train")]
pub mod experiment;
pub mod expr;
pub mod files;
pub mod formats;
pub mod identify;
pub mod lanes;
pub mod limits;
#[cfg(feature = "train")]
pub mod mbrl;
pub mod model;
pub mod plan;
pub mod plant;
pub mod report;
pub mod runs;
pub mod sim;
#[cfg(feature = "train")]
pub mod train;

mod decomposition;
mod guarded;
mod layout;

pub use closeloop::{Finding, Outcome, Reference, Request, Settings, Verdict, close_loop};
pub use data::Log;
pub use model::{Library, Model, Origin, Parameter};
pub use sim::metric::Trace;

/// Random numbers for whatever takes them as an argument: the same seed gives the same results.
pub fn rng(seed: u64) -> rand_chacha::ChaCha8Rng {
    rand::SeedableRng::seed_from_u64(seed)
}
