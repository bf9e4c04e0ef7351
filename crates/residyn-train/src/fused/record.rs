use super::problem::Problem;
use residyn_core::sim::batch::{Network, Rows};

/// The layout of the data that the reverse sweep needs from the forward sweep, for the blocks of a chunk: the stages
/// one after another, then the state at the end of each step.
pub(super) struct Layout {
    blocks: usize,
    states: usize,
    /// Rows of one stage and block.
    stage: usize,
    stages: usize,
}

/// One stage, each part `[block][value]`.
pub(super) struct StageRecord<'a> {
    pub states: &'a mut [Rows],
    /// Activations of each network, in the structure's order.
    pub networks: [Activations<'a>; 2],
}

/// The features of a network and the outputs of its layers.
#[derive(Default)]
pub(super) struct Activations<'a> {
    pub features: &'a mut [Rows],
    pub values: &'a mut [Rows],
}

impl Layout {
    /// The layout for a chunk of `blocks` blocks.
    pub(super) fn new(problem: &Problem, networks: &[Network], blocks: usize) -> Self {
        Self {
            blocks,
            states: problem.structure.states(),
            stage: problem.recorded_by_stage(networks),
            stages: problem.stages(),
        }
    }

    pub(super) fn stage<'a>(
        &self,
        record: &'a mut [Rows],
        stage: usize,
        networks: &[Network],
    ) -> StageRecord<'a> {
        let rows = self.blocks * self.stage;
        let (states, mut rest) =
            record[stage * rows..][..rows].split_at_mut(self.blocks * self.states);
        let mut parts = [Activations::default(), Activations::default()];
        for (part, network) in parts.iter_mut().zip(networks) {
            let (features, after) = rest.split_at_mut(self.blocks * network.features());
            let (values, after) = after.split_at_mut(self.blocks * network.activations());
            *part = Activations { features, values };
            rest = after;
        }
        StageRecord {
            states,
            networks: parts,
        }
    }

    /// The states at the end of step `k`.
    pub(super) fn end<'a>(&self, record: &'a mut [Rows], k: usize) -> &'a mut [Rows] {
        let rows = self.blocks * self.states;
        &mut record[self.stages * self.blocks * self.stage + k * rows..][..rows]
    }
}
