//! The core of Residyn: models as programs, their simulation, identification, and the loop from a residual to the physical
//! effect behind it.
//!
//! Arrays and texts go in, values come out: no file is opened here, no clock read, no process started, and random
//! numbers are an argument. The caller monitors or stops long work through a [`closeloop::Watch`].
//!
//! Models and effects are made from text, logs from arrays that a program has recorded.
//!
//! ```
//! use residyn_core::closeloop::Request;
//! use residyn_core::data::{Channels, Quantity};
//! use residyn_core::model::Library;
//! use residyn_core::sim::metric::traces;
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
//! request.settings.split.test_share = 0.5; // the share of logs that it sets apart
//! # assert!(predicted.iter().all(|trace| (trace.q[0][10] - trace.q[0][0]).abs() < 0.3));
//! # assert!(predicted.len() > 5);
//! # Ok(())
//! # }
//! ```

pub mod closeloop;
pub mod data;
pub mod decomposition;
pub mod digits;
pub mod expr;
pub mod identify;
pub mod lanes;
pub mod layout;
pub mod limits;
pub mod model;
pub mod plant;
pub mod sim;
pub mod streams;
pub mod toml_text;

/// The random number generator that functions take as an argument: the same seed gives the same results.
pub fn rng(seed: u64) -> rand_chacha::ChaCha8Rng {
    rand::SeedableRng::seed_from_u64(seed)
}
