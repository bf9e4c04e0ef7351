use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What a run's random numbers are for. Each purpose has its own stream, so that more draws for one purpose do not
/// change another, and so has each round of a loop, so that an interrupted run resumes with the same numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Training segments of a recipe's plant.
    RecipeTraining,
    /// Test segments of a recipe's plant.
    RecipeTest,
    /// Initial weights of a recipe's network.
    RecipeNetwork,
    /// Order of the minibatches of a recipe.
    RecipeOrder,
    /// Initial weights of networks in a round.
    Network(usize),
    /// Order of minibatches in a round.
    Order(usize),
    /// Initial state of the plant in an episode.
    Start(usize),
    /// Torques before there is a model.
    Random(usize),
    /// Sensor noise while data is gathered.
    Gather(usize),
    /// The planner's samples while data is gathered.
    GatherPlan(usize),
    /// Initial state and sensor noise of an episode that judges a model.
    Judge(usize),
    /// The planner's samples in such an episode.
    JudgePlan(usize),
    /// Everything else.
    Other(usize),
}

/// The ChaCha stream of a purpose. Every result depends on these numbers: they never change.
enum Source {
    /// A numbered stream of the key that the seed gives.
    OfSeed(u64),
    /// A key made of seed, purpose and round.
    OfKey(u64, usize),
}

impl Purpose {
    fn source(self) -> Source {
        match self {
            Self::RecipeTraining => Source::OfSeed(0),
            Self::RecipeTest => Source::OfSeed(1),
            Self::RecipeNetwork => Source::OfSeed(2),
            Self::RecipeOrder => Source::OfSeed(3),
            Self::Network(round) => Source::OfKey(1, round),
            Self::Order(round) => Source::OfKey(2, round),
            Self::Start(episode) => Source::OfKey(3, episode),
            Self::Random(round) => Source::OfKey(4, round),
            Self::Gather(round) => Source::OfKey(5, round),
            Self::GatherPlan(round) => Source::OfKey(6, round),
            Self::Judge(episode) => Source::OfKey(7, episode),
            Self::JudgePlan(episode) => Source::OfKey(8, episode),
            Self::Other(number) => Source::OfKey(9, number),
        }
    }
}

/// The random numbers of a seed for a purpose.
pub fn stream(seed: u64, purpose: Purpose) -> ChaCha8Rng {
    match purpose.source() {
        Source::OfSeed(number) => {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(number);
            rng
        }
        Source::OfKey(number, round) => {
            let mut key = [0; 32];
            let words = [seed, number, round as u64];
            for (bytes, word) in key.chunks_exact_mut(8).zip(words) {
                bytes.copy_from_slice(&word.to_le_bytes());
            }
            ChaCha8Rng::from_seed(key)
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::Rng;

    use super::{Purpose, stream};

    /// Computed with another implementation of ChaCha.
    #[test]
    fn streams_never_change() {
        let first = |purpose| stream(7, purpose).next_u64();
        assert_eq!(first(Purpose::RecipeNetwork), 0x4cd5_36ac_9650_8809);
        assert_eq!(first(Purpose::RecipeOrder), 0x2e79_8710_8688_b271);
        assert_eq!(first(Purpose::JudgePlan(3)), 0x7671_dbd4_287b_40b6);
    }
}
