//! Residyn: from a rig's log to the physical effect that its model lacks.
//!
//! A model is a file; its equations are parsed once into one small program, and everything else reads that program.
//! [`close_loop`] fits a declared model to logs and names the effects that it lacks. The following finds them, predicts
//! a log with them, and writes the report:
//!
//! ```
//! use residyn::{Library, Origin, Request, close_loop, read_log, read_logs, report, rng};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # std::env::set_current_dir(&folder)?;
//! # let mut rig = residyn::read_plant("pendulum".as_ref(), &Library::built_in())?;
//! # let (joint, friction) = (residyn::core::data::Joint::at(0), [("F_c".to_owned(), 0.2)]);
//! # rig.add_effect(&Library::built_in(), "coulomb_friction", joint, &friction)?;
//! # for k in 1..=4 {
//! #     residyn::write_log(&rig.record(&mut rng(k))?, format!("run{k}.csv"))?;
//! # }
//! let library = Library::built_in();
//! let model = library.model("pendulum")?; // or read_model(PATH, &library)
//! let logs = read_logs(["run1.csv", "run2.csv", "run3.csv"], &model)?;
//! let outcome = close_loop(Request::of(&model, &library, logs), &mut rng(0), &())?;
//! for effect in &outcome.effects.findings {
//!     println!("{effect}"); // name, joint, parameters with 95 % intervals
//! }
//! let predicted = outcome.models.after.predict(&read_log("run4.csv", &model)?, 0.5);
//! report::write("report", &outcome, &Origin::of_seed(0))?;
//! # println!("{} predictions", predicted.len());
//! # assert_eq!(outcome.effects.findings.len(), 1);
//! # assert!(outcome.effects.findings[0].to_string().starts_with("coulomb_friction on joint 1: F_c1 = 0."));
//! # assert!(predicted.len() > 10 && std::path::Path::new("report/report.md").is_file());
//! # Ok(())
//! # }
//! ```
//!
//! None of this needs a file: [`Library::with_effect`] and [`Library::model_from_text`] take texts, [`Channels`] makes
//! a log from arrays. Everything beyond these names is in the crates behind them:
//!
//! | crate | holds |
//! |---|---|
//! | [`core`] | models as programs, simulation, identification, closing the loop; opens no file |
//! | [`io`] | logs, models and run folders as files |
//! | [`formats`] | other programs' formats, in and out |
//! | [`report`] | what was found, as HTML, Markdown, JSON, plots |
//! | [`control`] | planners, tasks, episodes |
//! | [`train`] | hybrid models as Burn modules, and their training |

#[cfg(feature = "cli")]
pub mod cli;
mod exported_task;
#[cfg(feature = "train")]
mod imported;

pub use exported_task::exported_task;
#[cfg(feature = "train")]
pub use imported::save_imported;
pub use residyn_core::closeloop::{
    Finding, Outcome, Reference, Request, Settings, Verdict, Watch, close_loop,
};
pub use residyn_core::data::{Channels, Log, Quantity};
pub use residyn_core::model::{Effect, Library, Model, Origin, Parameter};
pub use residyn_core::rng;
pub use residyn_core::sim::metric::Trace;
pub use residyn_io::{
    read_log, read_log_from, read_logs, read_model, read_plant, read_standard_log, with_effects_in,
    write_log,
};
#[cfg(feature = "train")]
#[doc(inline)]
pub use residyn_train as train;
#[doc(inline)]
pub use {
    residyn_control as control, residyn_core as core, residyn_formats as formats, residyn_io as io,
    residyn_report as report,
};
