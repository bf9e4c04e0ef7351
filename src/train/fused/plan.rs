use std::ops::Range;
use std::sync::Arc;

use super::Blocks;
use crate::sim::Integrator;
use crate::sim::batch::{Network, Rows};
use crate::train::Frame;

/// Blocks of rows that a thread takes through the model together: enough to share the reading of weights, and few
/// enough that all that is made of them stays near the processor.
pub(super) const CHUNK: usize = 8;

/// 1 GiB of records.
pub(super) const KEPT: usize = (1 << 30) / size_of::<Rows>();

/// What stays the same while a loss and its derivative are taken.
#[derive(Debug)]
pub(super) struct Plan {
    pub frame: Arc<Frame>,
    pub blocks: Arc<Blocks>,
    pub integrator: Integrator,
    /// 1 / scale of each state's error.
    pub precision: Arc<[f32]>,
    /// Records of more rows than these together are not kept: the way back then begins with the way there again.
    pub kept: usize,
}

/// The learnable numbers as the kernels read them.
#[derive(Debug)]
pub(super) struct Numbers {
    /// Physical parameters in their units.
    pub parameters: Vec<f32>,
    pub networks: Vec<Network>,
}

impl Plan {
    /// Derivatives of the dynamics that a segment's rollout takes.
    pub(super) fn stages(&self) -> usize {
        self.blocks.steps * self.integrator.substeps() * self.integrator.scheme().stages.len()
    }

    /// Over how many rows and steps the means of the loss go.
    pub(super) fn count(&self) -> f64 {
        (self.blocks.size * self.blocks.steps) as f64
    }

    /// Rows of the record of one block.
    pub(super) fn recorded(&self, networks: &[Network]) -> usize {
        let of_networks: usize = (networks.iter())
            .map(|network| network.features() + network.activations())
            .sum();
        let states = 2 * self.frame.joints;
        self.stages() * (states + of_networks) + self.blocks.steps * states
    }

    /// Whether the records of all blocks are kept.
    pub(super) fn keeps(&self, networks: &[Network]) -> bool {
        self.blocks.count() * self.recorded(networks) <= self.kept
    }

    /// The blocks in parts of nearly equal size. They do not hang on the number of threads, so that the sums over
    /// them do not.
    pub(super) fn parts(&self) -> impl Iterator<Item = Range<usize>> {
        let count = self.blocks.count();
        let parts = count.div_ceil(CHUNK).min(8 + count / 64).min(64);
        (0..parts).map(move |part| part * count / parts..(part + 1) * count / parts)
    }
}

impl Numbers {
    /// All zero.
    pub(super) fn new(frame: &Frame) -> Self {
        let networks = frame.networks.iter().map(|made| {
            let count = made.layers.iter().map(|layer| layer.numbers()).sum();
            Network::new(&made.widths(), &vec![0.0; count])
        });
        Self {
            parameters: vec![0.0; frame.parameters().len()],
            networks: networks.collect(),
        }
    }

    /// The numbers of the prior and of the residual.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn set(&mut self, frame: &Frame, prior: &[f32], residual: &[f32]) {
        let parameters = frame.parameters().iter().zip(prior);
        for (to, (parameter, scaled)) in self.parameters.iter_mut().zip(parameters) {
            *to = match parameter.fixed {
                true => parameter.value as f32,
                false => scaled * parameter.scale as f32,
            };
        }
        let flat = match frame.equations {
            None => [prior, residual],
            Some(_) => [residual, &[]],
        };
        for (network, flat) in self.networks.iter_mut().zip(flat) {
            network.set_numbers(flat);
        }
    }
}
