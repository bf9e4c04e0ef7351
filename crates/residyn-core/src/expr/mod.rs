//! Equations as programs: a formula is text that is parsed once and becomes a [`Program`], a flat list of about two
//! dozen scalar operations. Everything else reads that list: the evaluator ([`Tape`]), the derivative
//! ([`Graph::gradient`]), the replay on tensors of training and the printers ([`Program::text`], [`Program::latex`]).
//!
//! This module knows nothing of files, optimisers and command lines.

mod constants;
mod error;
mod eval;
mod gradient;
mod graph;
mod inline;
mod latex;
mod notation;
mod op;
mod parse;
mod places;
mod print;
mod program;
mod scope;
mod steps;
mod unit;
mod units;

pub use error::{FormulaError, suggestion};
pub use error::{listed, shortened};
pub use eval::Tape;
pub use graph::Graph;
pub use latex::latex_name;
pub use notation::{Notation, Part};
pub use op::{Binary, Node, Op, Unary, is_function};
pub use parse::{Formula, parse, parse_finite};

pub use program::Program;
pub use scope::{Scope, SignForm};
pub use unit::{BASE, Unit, is_of_torque};
