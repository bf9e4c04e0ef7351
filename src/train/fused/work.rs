use std::sync::{Arc, Mutex};

use pulp::Arch;
use rayon::prelude::*;

use super::part::{Backward, Forward, Part};
use super::plan::{Numbers, Plan};
use crate::train::loss::NORM_FLOOR;

/// Working memory that serves again for the next loss.
#[derive(Debug, Default)]
pub struct Memory(Mutex<Vec<Vec<Part>>>);

impl Memory {
    fn take(&self) -> Vec<Part> {
        self.parts().pop().unwrap_or_default()
    }

    fn give_back(&self, parts: Vec<Part>) {
        self.parts().push(parts);
    }

    fn parts(&self) -> std::sync::MutexGuard<'_, Vec<Vec<Part>>> {
        self.0
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

/// A loss that was taken, and all that its derivative needs.
#[derive(Debug)]
pub(super) struct Work {
    plan: Arc<Plan>,
    numbers: Numbers,
    parts: Vec<Part>,
    memory: Arc<Memory>,
    /// E and the norm of F_r.
    pub loss: [f32; 2],
}

impl Work {
    /// Take the loss with these numbers.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn new(
        plan: &Arc<Plan>,
        memory: &Arc<Memory>,
        prior: &[f32],
        residual: &[f32],
    ) -> Self {
        let numbers = plan.numbers(prior, residual);
        let mut parts = memory.take();
        let ranges: Vec<_> = plan.parts().collect();
        parts.resize_with(ranges.len(), Part::default);
        for (part, blocks) in parts.iter_mut().zip(ranges) {
            part.begin(blocks, plan, &numbers);
        }
        parts.par_iter_mut().for_each(|part| {
            Arch::new().dispatch(Forward {
                plan,
                numbers: &numbers,
                part,
            });
        });
        // In the order of the parts, so that the result does not hang on which was done first.
        let mean = |k: usize| parts.iter().map(|part| part.sums[k]).sum::<f64>() / plan.count();
        let norm = match plan.frame.has_residual {
            true => (mean(1) + NORM_FLOOR * NORM_FLOOR).sqrt(),
            false => 0.0,
        };
        Self {
            loss: [mean(0) as f32, norm as f32],
            plan: plan.clone(),
            numbers,
            parts,
            memory: memory.clone(),
        }
    }

    /// From the derivatives of a number by the two parts of the loss to those by the prior's numbers and the
    /// residual's.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn derivative(&mut self, by_loss: [f32; 2]) -> [Vec<f32>; 2] {
        let Self {
            plan,
            numbers,
            parts,
            loss,
            ..
        } = self;
        let by_mean = match plan.frame.has_residual {
            true => f64::from(by_loss[1]) / (2.0 * f64::from(loss[1])),
            false => 0.0,
        };
        let seeds = [f64::from(by_loss[0]), by_mean].map(|by| (by / plan.count()) as f32);
        parts.par_iter_mut().for_each(|part| {
            Arch::new().dispatch(Backward {
                plan,
                numbers,
                part,
                seeds,
            });
        });
        self.gathered()
    }

    /// The sum of what the parts found.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    fn gathered(&mut self) -> [Vec<f32>; 2] {
        let (first, others) = self.parts.split_first_mut().expect("there is a part");
        for other in others {
            let networks = first.by_networks.iter_mut().zip(&other.by_networks);
            for (sum, more) in networks.flat_map(|(sums, more)| sums.iter_mut().zip(more)) {
                *sum += more;
            }
            for (sum, more) in first.by_parameters.iter_mut().zip(&other.by_parameters) {
                *sum += more;
            }
        }
        let mut free = first.by_parameters.iter();
        let parameters = self.plan.frame.parameters().iter().map(|p| match p.fixed {
            true => 0.0,
            false => (free.next().expect("one number for each free parameter") * p.scale) as f32,
        });
        let mut networks = std::mem::take(&mut first.by_networks).into_iter();
        let prior = match self.plan.frame.equations {
            None => networks.next().unwrap_or_default(),
            Some(_) => parameters.collect(),
        };
        [prior, networks.next().unwrap_or_default()]
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        self.memory.give_back(std::mem::take(&mut self.parts));
    }
}
