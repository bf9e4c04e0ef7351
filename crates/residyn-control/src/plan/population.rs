use residyn_core::sim::batch::{Rows, W};

/// The candidates of one iteration and their returns.
pub struct Population<'a> {
    /// Inputs of each block of candidates, `[step * n + input]`.
    inputs: Vec<&'a [Rows]>,
    /// Finite returns with the indices of their candidates, in order.
    known: Vec<(f32, usize)>,
    size: usize,
}

impl<'a> Population<'a> {
    /// The first `size` candidates of these blocks: inputs and returns.
    pub(super) fn new(blocks: impl Iterator<Item = (&'a [Rows], &'a Rows)>, size: usize) -> Self {
        let (inputs, returns): (Vec<_>, Vec<&Rows>) = blocks.unzip();
        let returns = returns.iter().flat_map(|row| row.0).zip(0..size);
        Self {
            inputs,
            known: returns.filter(|(value, _)| value.is_finite()).collect(),
            size,
        }
    }

    /// Number of candidates whose return is not finite.
    pub fn diverged(&self) -> usize {
        self.size - self.known.len()
    }

    /// The best return, minus infinity if all diverged.
    pub fn best(&self) -> f32 {
        let values = self.known.iter().map(|(value, _)| *value);
        values.fold(f32::NEG_INFINITY, f32::max)
    }

    /// The median of the finite returns, the upper of two; minus infinity if there are none.
    pub fn median(&self) -> f32 {
        self.elite(self.known.len().div_ceil(2))
            .last()
            .map_or(f32::NEG_INFINITY, |(value, _)| *value)
    }

    /// The `count` candidates with the highest finite returns (or all, if fewer), best first.
    pub fn elite(&self, count: usize) -> Vec<(f32, usize)> {
        let mut ranking = self.known.clone();
        let best_first =
            |a: &(f32, usize), b: &(f32, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if ranking.len() > count {
            ranking.select_nth_unstable_by(count, best_first);
            ranking.truncate(count);
        }
        ranking.sort_unstable_by(best_first);
        ranking
    }

    /// One entry of a candidate's sequence.
    pub fn number(&self, candidate: usize, number: usize) -> f32 {
        self.inputs[candidate / W][number][candidate % W]
    }

    /// The whole sequence of a candidate.
    pub fn sequence(&self, candidate: usize) -> Vec<f32> {
        let rows = self.inputs[candidate / W].iter();
        rows.map(|row| row[candidate % W]).collect()
    }

    /// The mean sequence of all candidates that did not diverge, weighted by `weight(return)`. `None` if all diverged.
    pub fn mean(&self, weight: impl Fn(f32) -> f32) -> Option<Vec<f32>> {
        let mut weights = vec![Rows::splat(0.0); self.inputs.len()];
        for (value, candidate) in &self.known {
            weights[candidate / W][candidate % W] = weight(*value);
        }
        let total: f32 = weights.iter().flat_map(|row| row.0).sum();
        let mean = |number: usize| {
            let mut sums = Rows::splat(0.0);
            for (inputs, weights) in self.inputs.iter().zip(&weights) {
                for lane in 0..W {
                    sums[lane] += weights[lane] * inputs[number][lane];
                }
            }
            sums.iter().sum::<f32>() / total
        };
        let numbers = self.inputs.first()?.len();
        (!self.known.is_empty()).then(|| (0..numbers).map(mean).collect())
    }
}
