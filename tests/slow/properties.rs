//! Properties that hold for any input: random formulas, models, reports and mechanisms survive being written and read,
//! and what closing the loop finds does not depend on how a rig is described.

use std::env;

use proptest::prelude::ProptestConfig;
use proptest::test_runner::RngSeed;

mod findings;
mod formulas;
mod mechanisms;
mod models;
mod printers;
mod reports;

/// Factor on the usual number of cases: `RESIDYN_PROPERTIES`, 1 by default. A larger number begins with the same cases.
fn times() -> u32 {
    let times = env::var("RESIDYN_PROPERTIES");
    times.map_or(1, |times| times.parse().expect("a whole number"))
}

/// A number of cases, the same ones in every run.
fn cases(usual: u32) -> ProptestConfig {
    ProptestConfig {
        cases: usual * times(),
        failure_persistence: None,
        max_shrink_iters: 10_000,
        rng_seed: RngSeed::Fixed(1),
        ..ProptestConfig::default()
    }
}

/// Numbers that are equal to the last bit, or both NaN.
fn same_number(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}
