use residyn_core::sim::batch::{Rows, W};

/// The candidates of one iteration and their values: the returns of those that keep the limits, or of all if there are none.
///
/// A candidate beyond limits ranks below all within, the farther beyond the lower (Deb 2000, "An efficient constraint handling
/// method for genetic algorithms"). A penalty in the return would need a weight, and the scale of an objective is not known;
/// this order has none.
pub struct Population<'a> {
    /// Inputs of each block of candidates, `[step * n + input]`.
    inputs: Vec<&'a [Rows]>,
    /// Finite values with the indices of their candidates, in order.
    known: Vec<(f32, usize)>,
    size: usize,
}

/// One block of candidates.
pub(super) struct Evaluated<'a> {
    /// `[step * n + input]`
    pub inputs: &'a [Rows],
    pub returns: &'a Rows,
    /// How far each goes beyond limits, if there are any.
    pub excess: Option<&'a Rows>,
}

impl<'a> Population<'a> {
    /// The first `size` candidates of these blocks.
    pub(super) fn new(blocks: impl Iterator<Item = Evaluated<'a>>, size: usize) -> Self {
        let blocks: Vec<_> = blocks.collect();
        let returns = blocks.iter().flat_map(|block| block.returns.0).zip(0..size);
        let mut known = returns.filter(|(value, _)| value.is_finite()).collect();
        let excess: Option<Vec<&Rows>> = blocks.iter().map(|block| block.excess).collect();
        if let Some(excess) = excess {
            put_below(&mut known, |candidate| excess[candidate / W][candidate % W]);
        }
        Self {
            inputs: blocks.iter().map(|block| block.inputs).collect(),
            known,
            size,
        }
    }

    /// Number of candidates whose return or excess is not finite.
    pub fn diverged(&self) -> usize {
        self.size - self.known.len()
    }

    /// The best value, minus infinity if all diverged.
    pub fn best(&self) -> f32 {
        let values = self.known.iter().map(|(value, _)| *value);
        values.fold(f32::NEG_INFINITY, f32::max)
    }

    /// The median of the finite values, the upper of two; minus infinity if there are none.
    pub fn median(&self) -> f32 {
        self.elite(self.known.len().div_ceil(2))
            .last()
            .map_or(f32::NEG_INFINITY, |(value, _)| *value)
    }

    /// The `count` candidates with the highest finite values (or all, if fewer), best first.
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

    /// The mean sequence of all candidates that did not diverge, weighted by `weight(value)`. `None` if all diverged.
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

/// Give candidates beyond limits values that continue those within below the worst, as far again as these spread: a method that
/// weighs candidates by their values finds the same plan whatever the units of the objective are.
fn put_below(known: &mut Vec<(f32, usize)>, excess: impl Fn(usize) -> f32) {
    known.retain(|(_, candidate)| excess(*candidate).is_finite());
    let within = known
        .iter()
        .filter(|(_, candidate)| excess(*candidate) == 0.0);
    let ends = within.fold(None, |ends: Option<[f32; 2]>, (value, _)| {
        let [worst, best] = ends.unwrap_or([*value; 2]);
        Some([worst.min(*value), best.max(*value)])
    });
    let [worst, best] = ends.unwrap_or([0.0; 2]);
    // Without a spread any keeps the order.
    let spread = match worst < best {
        true => best - worst,
        false => 1.0 + worst.abs(),
    };
    let all = known.iter().map(|(_, candidate)| excess(*candidate));
    let farthest = all.fold(0.0, f32::max);
    for (value, candidate) in known {
        let beyond = excess(*candidate);
        if beyond > 0.0 {
            *value = worst - spread * (beyond / farthest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The ranking of candidates with these returns and excesses.
    fn ranked(returns: &[f32], excess: &[f32]) -> Vec<(f32, usize)> {
        let rows = |values: &[f32]| {
            let mut rows = Rows::splat(0.0);
            rows[..values.len()].copy_from_slice(values);
            rows
        };
        let (returns_of, excess_of) = (rows(returns), rows(excess));
        let block = Evaluated {
            inputs: &[],
            returns: &returns_of,
            excess: (!excess.is_empty()).then_some(&excess_of),
        };
        Population::new([block].into_iter(), returns.len()).elite(returns.len())
    }

    #[test]
    fn a_candidate_beyond_limits_ranks_below_all_within_by_how_far_it_is_beyond() {
        let returns = [1.0, 100.0, 3.0, 200.0, f32::NAN, 2.0];
        let found = ranked(&returns, &[0.0, 0.5, 0.0, 2.0, 0.0, f32::NAN]);
        assert_eq!(found, [(3.0, 2), (1.0, 0), (0.5, 1), (-1.0, 3)]);
        // One within, and none.
        let found = ranked(&[1.0, 100.0], &[0.0, 0.5]);
        assert_eq!(found, [(1.0, 0), (-1.0, 1)]);
        let found = ranked(&[1.0, 100.0], &[0.25, 0.5]);
        assert_eq!(found, [(-0.5, 0), (-1.0, 1)]);
        // All within, and no limits.
        for excess in [&[0.0, 0.0][..], &[]] {
            assert_eq!(ranked(&[1.0, 100.0], excess), [(100.0, 1), (1.0, 0)]);
        }
    }
}
