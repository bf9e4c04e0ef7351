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
//!
//! Nothing of that needs a file: models and effects are made from text, logs from what a program has recorded.
//!
//! ```
//! use residyn::sim::metric::traces;
//! use residyn::{Channels, Library, Quantity, Request};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let eddy_brake = r#"
//!     [effect]
//!     name = "eddy_brake"
//!     about = "brake that loses its grip at speed"
//!     force = "-b*qd/(1 + (qd/v_0)^2)"
//!     [parameters]
//!     b = { unit = "N m s/rad", about = "torque per speed at low speed", typical = 0.1, positive = true }
//!     v_0 = { unit = "rad/s", about = "speed of the largest torque", typical = 5.0, positive = true }
//! "#;
//! let flywheel = r#"
//!     [system]
//!     name = "flywheel"
//!     joints = 1
//!     [parameters]
//!     J = { value = 0.2, unit = "kg m^2", positive = true }
//!     [dynamics]
//!     qdd1 = "tau1/J"
//! "#;
//! let library = Library::built_in().with_effect(eddy_brake.parse()?);
//! let model = library.model_from_text("flywheel", flywheel)?;
//! let time: Vec<f64> = (0..400).map(|row| 0.01 * f64::from(row)).collect();
//! let log = Channels {
//!     q: vec![time.iter().map(|t| 0.25 * t * t).collect()],
//!     driven: Some((Quantity::Torque, vec![vec![0.1; time.len()]])),
//!     time,
//!     ..Channels::default()
//! }
//! .log("spin-up")?;
//! let predicted = traces(&model.dynamics(), &log, 0.5);
//! let mut request = Request::of(&model, &library, vec![log]); // for `close_loop`
//! request.settings.split.test_share = 0.5; // it divides the logs when the loop is closed
//! # assert!(predicted.iter().all(|trace| (trace.q[0][10] - trace.q[0][0]).abs() < 0.3));
//! # assert!(predicted.len() > 5);
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
pub use data::{Channels, Log, Quantity};
pub use model::{Effect, Library, Model, Origin, Parameter};
pub use sim::metric::Trace;

/// Random numbers for whatever takes them as an argument: the same seed gives the same results.
pub fn rng(seed: u64) -> rand_chacha::ChaCha8Rng {
    rand::SeedableRng::seed_from_u64(seed)
}
