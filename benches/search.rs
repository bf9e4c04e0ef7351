//! The planner whose decisions are timed.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use residyn_control::plan::{Cem, Method, Planner, Settings};
use residyn_core::sim::batch::{Block, Rollouts};

/// A cross-entropy search of 10 iterations for torques within 3 N m.
pub fn planner(rollouts: &Rollouts, population: usize, horizon: usize) -> Planner<Block<'_>> {
    let settings = Settings {
        population,
        iterations: 10,
        horizon,
        method: Method::Cem(Cem { elite: 20 }),
    };
    let bounds = vec![[-3.0, 3.0]; rollouts.joints()];
    let rng = ChaCha8Rng::seed_from_u64(4);
    Planner::new(&settings, &bounds, || rollouts.block(), &rng)
}
