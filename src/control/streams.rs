use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What random numbers of a run are for: each purpose has its own in each round, so that a run goes on as if it had not
/// been interrupted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// First numbers of networks.
    Network = 1,
    /// Order of minibatches.
    Order,
    /// Starts of the plant.
    Start,
    /// Torques before there is a model.
    Random,
    /// Noise of the sensors while data is gathered.
    Gather,
    /// The planner while data is gathered.
    GatherPlan,
    /// Start and noise of the episode by which models are judged.
    Judge,
    /// The planner in that episode.
    JudgePlan,
    /// What a seed is used for beyond a run.
    Other,
}

/// The random numbers of a seed for a purpose in a round. They leave the generator's own streams free.
pub fn stream(seed: u64, purpose: Purpose, round: usize) -> ChaCha8Rng {
    let mut key = [0; 32];
    let words = [seed, purpose as u64, round as u64];
    for (bytes, word) in key.chunks_exact_mut(8).zip(words) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}
