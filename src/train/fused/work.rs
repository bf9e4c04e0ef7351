use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use pulp::Arch;

use super::part::{Backward, Forward, Part};
use super::plan::{Numbers, Plan};
use crate::model::Frame;
use crate::train::loss::NORM_FLOOR;

/// Memory that serves again for the next loss.
#[derive(Debug, Default)]
pub struct Memory(Mutex<Vec<Desks>>);

/// All that a loss of one model is worked out with.
#[derive(Debug)]
struct Desks {
    frame: Arc<Frame>,
    numbers: Numbers,
    parts: Vec<Part>,
}

/// A loss that was taken, and all that its derivative needs.
#[derive(Debug)]
pub(super) struct Work {
    plan: Arc<Plan>,
    /// Given back at the end.
    desks: Option<Desks>,
    memory: Arc<Memory>,
    /// E and the norm of F_r.
    pub loss: [f32; 2],
}

impl Memory {
    fn take(&self, frame: &Arc<Frame>) -> Desks {
        let known = self.lock().pop();
        let fits = known.filter(|desks| Arc::ptr_eq(&desks.frame, frame));
        fits.unwrap_or_else(|| Desks {
            frame: frame.clone(),
            numbers: Numbers::new(frame),
            parts: Vec::new(),
        })
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Desks>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Work {
    /// Take the loss with these numbers.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn new(
        plan: Arc<Plan>,
        memory: Arc<Memory>,
        prior: &[f32],
        residual: &[f32],
    ) -> Self {
        let mut desks = memory.take(&plan.frame);
        let Desks { numbers, parts, .. } = &mut desks;
        numbers.set(&plan.frame, prior, residual);
        let count = plan.parts().count();
        parts.resize_with(count, || Part::new(&plan.frame));
        for (part, blocks) in parts.iter_mut().zip(plan.parts()) {
            part.begin(blocks, &plan, numbers);
        }
        for_each(parts, &|part: &mut Part| {
            Arch::new().dispatch(Forward {
                plan: &plan,
                numbers,
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
            desks: Some(desks),
            plan,
            memory,
        }
    }

    /// From the derivatives of a number by the two parts of the loss to those by the prior's numbers and the
    /// residual's.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn derivative(&mut self, by_loss: [f32; 2]) -> [Vec<f32>; 2] {
        let (plan, loss) = (&self.plan, self.loss);
        let desks = self.desks.as_mut().expect("given back at the end alone");
        let Desks { numbers, parts, .. } = desks;
        let by_mean = match plan.frame.has_residual {
            true => f64::from(by_loss[1]) / (2.0 * f64::from(loss[1])),
            false => 0.0,
        };
        let seeds = [f64::from(by_loss[0]), by_mean].map(|by| (by / plan.count()) as f32);
        for_each(parts, &|part: &mut Part| {
            Arch::new().dispatch(Backward {
                plan,
                numbers,
                part,
                seeds,
            });
        });
        gathered(&plan.frame, parts)
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        self.memory.lock().extend(self.desks.take());
    }
}

/// Do a piece of work for each part. What other threads have not begun when this one is ready it does itself.
fn for_each(parts: &mut [Part], work: &(impl Fn(&mut Part) + Sync)) {
    match parts {
        [] => {}
        [part] => work(part),
        _ => {
            let (first, second) = parts.split_at_mut(parts.len() / 2);
            rayon::join(|| for_each(first, work), || for_each(second, work));
        }
    }
}

/// The sum of what the parts found.
#[allow(clippy::cast_possible_truncation)] // training runs in f32
fn gathered(frame: &Frame, parts: &mut [Part]) -> [Vec<f32>; 2] {
    let (first, others) = parts.split_first_mut().expect("there is a part");
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
    let parameters = frame.parameters().iter().map(|p| match p.fixed {
        true => 0.0,
        false => (free.next().expect("one number for each free parameter") * p.scale) as f32,
    });
    let mut networks = std::mem::take(&mut first.by_networks).into_iter();
    let prior = match frame.equations {
        None => networks.next().unwrap_or_default(),
        Some(_) => parameters.collect(),
    };
    [prior, networks.next().unwrap_or_default()]
}
