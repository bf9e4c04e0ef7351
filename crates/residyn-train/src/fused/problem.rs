use std::ops::Range;
use std::sync::Arc;

use super::Blocks;
use crate::Structure;
use residyn_core::sim::Integrator;
use residyn_core::sim::batch::{Network, Rows};

/// Blocks of rows that a thread takes through the model together: enough to amortise reading the weights, and few
/// enough that their intermediate values stay in the processor's cache.
pub(super) const CHUNK: usize = 8;

/// Number of rows in 1 GiB of records.
pub(super) const RECORD_LIMIT: usize = (1 << 30) / size_of::<Rows>();

/// A loss without the learnable numbers: model, data, integrator and units of the errors.
#[derive(Debug)]
pub(crate) struct Problem {
    pub structure: Arc<Structure>,
    pub blocks: Arc<Blocks>,
    pub integrator: Integrator,
    /// 1 / scale of each state's error.
    pub precision: Arc<[f32]>,
    /// Above this number of rows, records are not kept: the reverse sweep repeats the forward sweep of each chunk.
    pub record_limit: usize,
}

/// The learnable numbers as the kernels read them.
#[derive(Debug)]
pub(super) struct Weights {
    /// Physical parameters in their units.
    pub parameters: Vec<f32>,
    pub networks: Vec<Network>,
}

impl Problem {
    /// `precision` is 1 / scale of each state's error.
    pub(crate) fn new(
        structure: &Arc<Structure>,
        blocks: &Arc<Blocks>,
        integrator: Integrator,
        precision: &Arc<[f32]>,
    ) -> Self {
        Self {
            structure: structure.clone(),
            blocks: blocks.clone(),
            integrator,
            precision: precision.clone(),
            record_limit: RECORD_LIMIT,
        }
    }

    /// Number of derivatives of the dynamics that a segment's rollout takes.
    pub(super) fn stages(&self) -> usize {
        self.blocks.steps * self.integrator.substeps() * self.integrator.scheme().stages.len()
    }

    /// Number of rows and steps that the means of the loss are taken over.
    pub(super) fn count(&self) -> f64 {
        (self.blocks.size * self.blocks.steps) as f64
    }

    /// Number of rows in the record of one stage and block.
    pub(super) fn recorded_by_stage(&self, networks: &[Network]) -> usize {
        let of_networks = networks.iter().map(|n| n.features() + n.activations());
        self.structure.states() + of_networks.sum::<usize>()
    }

    /// Number of rows in the record of one block.
    pub(super) fn recorded(&self, networks: &[Network]) -> usize {
        let ends = self.blocks.steps * self.structure.states();
        self.stages() * self.recorded_by_stage(networks) + ends
    }

    /// Whether the records of all blocks are kept from the forward to the reverse sweep.
    pub(super) fn keeps_records(&self, networks: &[Network]) -> bool {
        self.blocks.count() * self.recorded(networks) <= self.record_limit
    }

    /// The blocks in parts of nearly equal size. The parts do not depend on the number of threads, so neither do the
    /// sums over them.
    pub(super) fn parts(&self) -> impl Iterator<Item = Range<usize>> {
        let count = self.blocks.count();
        let parts = count.div_ceil(CHUNK).min(8 + count / 64).min(64);
        (0..parts).map(move |part| part * count / parts..(part + 1) * count / parts)
    }
}

impl Weights {
    /// All zero.
    pub(super) fn new(structure: &Structure) -> Self {
        let networks = structure.networks.iter().map(|made| {
            let count = made.layers.iter().map(|layer| layer.numbers()).sum();
            Network::new(&made.widths(), &vec![0.0; count])
        });
        Self {
            parameters: vec![0.0; structure.parameters().len()],
            networks: networks.collect(),
        }
    }

    /// Sets the learnable numbers, in the order of [`HybridModel::flat`](crate::HybridModel::flat).
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn set(&mut self, structure: &Structure, numbers: &[f32]) {
        let (scaled, mut rest) = numbers.split_at(self.parameters.len());
        let parameters = structure.parameters().iter().zip(scaled);
        for (to, (parameter, scaled)) in self.parameters.iter_mut().zip(parameters) {
            *to = match parameter.fixed {
                true => parameter.value as f32,
                false => scaled * parameter.scale as f32,
            };
        }
        for network in &mut self.networks {
            let (numbers, after) = rest.split_at(network.numbers());
            network.set_by_input(numbers);
            rest = after;
        }
    }
}
