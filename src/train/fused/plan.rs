use std::ops::Range;
use std::sync::Arc;

use super::Blocks;
use super::scheme::Scheme;
use crate::batch::Network;
use crate::model::{Frame, Integrator};

/// Rows that the derivatives by a network's numbers are taken for at once, in blocks: few enough that what they need
/// stays near the processor.
pub(super) const CHUNK: usize = 4;

/// What stays the same while a loss and its derivative are taken.
#[derive(Debug)]
pub(super) struct Plan {
    pub frame: Arc<Frame>,
    pub blocks: Arc<Blocks>,
    pub scheme: Scheme,
    /// 1 / scale of each state's error.
    pub precision: Vec<f32>,
}

/// The learnable numbers as the kernels read them.
#[derive(Debug)]
pub(super) struct Numbers {
    /// Physical parameters in their units.
    pub parameters: Vec<f32>,
    pub networks: Vec<Network>,
}

impl Plan {
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn new(
        frame: &Arc<Frame>,
        blocks: &Arc<Blocks>,
        integrator: Integrator,
        scale: &[f64],
    ) -> Self {
        Self {
            frame: frame.clone(),
            blocks: blocks.clone(),
            scheme: Scheme::of(integrator),
            precision: scale.iter().map(|scale| (1.0 / scale) as f32).collect(),
        }
    }

    /// The numbers of both tensors.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn numbers(&self, prior: &[f32], residual: &[f32]) -> Numbers {
        let flat = match self.frame.equations {
            None => [prior, residual],
            Some(_) => [residual, &[]],
        };
        let networks = self.frame.networks.iter().zip(flat);
        let parameters = self.frame.parameters().iter().zip(prior);
        Numbers {
            parameters: parameters
                .map(|(p, scaled)| match p.fixed {
                    true => p.value as f32,
                    false => scaled * p.scale as f32,
                })
                .collect(),
            networks: networks
                .map(|(made, flat)| Network::new(&made.widths(), flat))
                .collect(),
        }
    }

    /// Derivatives of the dynamics that a segment's rollout takes.
    pub(super) fn stages(&self) -> usize {
        self.blocks.steps * self.scheme.substeps * self.scheme.stages.len()
    }

    /// Over how many rows and steps the means of the loss go.
    pub(super) fn count(&self) -> f64 {
        (self.blocks.size * self.blocks.steps) as f64
    }

    /// The blocks in as many parts of nearly equal size as there are threads that have enough to do.
    pub(super) fn parts(&self) -> impl Iterator<Item = Range<usize>> {
        let count = self.blocks.count();
        let parts = rayon::current_num_threads().min(count.div_ceil(2));
        (0..parts).map(move |part| part * count / parts..(part + 1) * count / parts)
    }
}
