use pulp::Simd;

use super::problem::CHUNK;
use crate::Structure;
use residyn_core::sim::batch::{GradientSums, Network, Rows};

/// Working memory of both sweeps over a chunk, reused for the next chunk.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    pub scratch: Scratch,
    /// For each network, the derivatives by its features, `[block][feature]`.
    pub by_features: Vec<Vec<Rows>>,
    /// For each network, the derivatives by its weights.
    pub network_sums: Vec<GradientSums>,
    /// The derivative by each parameter that is not fixed.
    pub parameter_sums: Vec<Rows>,
}

/// Data that the sweeps carry from stage to stage, each part `[block][state]`: values in the forward sweep, derivatives
/// in the reverse sweep.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// The state; the derivative by it.
    pub state: Vec<Rows>,
    /// The rates of the current stage; the derivative by them.
    pub rates: Vec<Rows>,
    /// The weighted mean of the stages' rates; the derivative by it.
    pub mean: Vec<Rows>,
    /// The derivative by the states of the current stage.
    pub by_stage: Vec<Rows>,
    /// The state at the start of the substep.
    pub begun: Vec<Rows>,
}

impl Workspace {
    /// Room for a chunk.
    pub(super) fn begin(&mut self, structure: &Structure, networks: &[Network]) {
        let Scratch {
            state,
            rates,
            mean,
            by_stage,
            begun,
        } = &mut self.scratch;
        for part in [state, rates, mean, by_stage, begun] {
            part.resize(CHUNK * structure.states(), Rows::splat(0.0));
        }
        self.by_features.resize(networks.len(), Vec::new());
        for (by, network) in self.by_features.iter_mut().zip(networks) {
            by.resize(CHUNK * network.features(), Rows::splat(0.0));
        }
    }

    /// Sets the derivatives by all learnable numbers to zero.
    pub(super) fn clear_sums<S: Simd>(&mut self, structure: &Structure, networks: &[Network]) {
        let free = structure.parameters().iter().filter(|p| !p.fixed).count();
        self.parameter_sums.clear();
        self.parameter_sums.resize(free, Rows::splat(0.0));
        self.network_sums
            .resize_with(networks.len(), GradientSums::default);
        for (sums, network) in self.network_sums.iter_mut().zip(networks) {
            sums.clear::<S>(network.numbers());
        }
    }
}
