//! Many numbers at a time: vectors as wide as the processor at hand has them (AVX-512, AVX2, NEON or one by one),
//! chosen when the program runs. What is written once here, for f32 and f64, serves every engine.

mod math;
mod pool;
mod row;
mod vector;

pub use pool::WorkerPool;
pub use row::Row;
pub use vector::{Element, Vector};

pub use pulp::{Arch, Simd, WithSimd};
