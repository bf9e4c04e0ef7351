//! Data parallelism: vectors as wide as the processor offers (AVX-512, AVX2, NEON, or single numbers), chosen at run
//! time and written once for f32 and f64, and a pool of worker threads.
//!
//! Code on vectors is `#[inline(always)]` and written as plain loops. A closure or an iterator that passes vectors
//! may become a function of its own, compiled without the processor's vector instructions, and then every vector goes
//! through memory; `benches/instructions` finds such functions.

mod math;
mod pool;
mod row;
mod vector;

pub use pool::WorkerPool;
pub use row::Row;
pub use vector::{Element, Vector};

pub use pulp::{Arch, Simd, WithSimd};
