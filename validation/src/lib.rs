//! Whether closing the loop names what is missing: a grid of simulated rigs that hide effects.
//!
//! The rigs share nothing with the program under test: equations of motion, friction with exact stiction, drives, gears
//! and encoders are written by hand here, and none of the program's model files, formulas or integrators is used until
//! the logs are recorded.

mod answer;
mod arm;
mod bodies;
mod cell;
mod condition;
mod coverage;
mod draw;
mod drive;
mod excitation;
mod files;
mod grid;
mod hidden;
mod identifiable;
mod judge;
pub mod laws;
mod machine;
mod mechanics;
mod motion;
mod presliding;
mod recording;
pub mod rigs;
mod robot;
mod rows;
mod sensors;
mod table;
mod transmission;
mod warming;
mod wires;

pub use arm::{Arm, Lacks};
pub use cell::{Errors, Findings, KnownStructure, Searched};
pub use condition::{Condition, Driving, Loop};
pub use coverage::Coverage;
pub use draw::{Drawn, Recipe, Rules};
pub use files::recorded;
pub use grid::{Cell, GridError, Group, Simulation, Source, cells, read};
pub use hidden::{Hidden, Label};
pub use judge::{Answer, Estimate, Judgement, Named, Truth, judge};
pub use machine::{Machine, State};
pub use mechanics::{Mechanics, Pair};
pub use robot::{Build, Hides, Robot};
pub use rows::{Rate, Row};
pub use sensors::Flaws;
pub use table::{Line, Summary, markdown, summarise};
