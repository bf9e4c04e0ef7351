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
//! Record a simulated pendulum that has friction, and measure how far the declared model, which has none, runs
//! from that log:
//!
//! ```
//! use std::path::Path;
//!
//! use rand::SeedableRng;
//! use residyn::sim::metric::{assess, summarise};
//! use residyn::data::Joint;
//! use residyn::model::Library;
//! use residyn::plant::Plant;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let library = Library::built_in();
//! let mut rig = Plant::read(Path::new("pendulum"), &library)?;
//! rig.add_effect(&library, "coulomb_friction", Joint::at(0), &[("F_c".to_owned(), 0.2)])?;
//! let log = rig.record(&mut rand_chacha::ChaCha8Rng::seed_from_u64(1))?;
//!
//! let declared = library.model(Path::new("pendulum"))?.dynamics();
//! let errors = assess(&declared, &[log], &[0.5]);
//! let summary = summarise(&errors.horizons, declared.joints);
//! assert!(summary.position_rmse[0][0] > 0.01, "friction shows within half a second");
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
