use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// 95 %, by resampling the seeds (Efron 1979).
pub type Interval = [f64; 2];

/// The share of a lost return that comes back with a model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WonBack {
    /// Of the mean returns; 1 where all of it does.
    pub share: f64,
    pub ci95: Interval,
}

const RESAMPLES: usize = 2000;

pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Of the sample; 0 of a single value.
pub(super) fn deviation(values: &[f64]) -> f64 {
    let middle = mean(values);
    let squares: f64 = values.iter().map(|value| (value - middle).powi(2)).sum();
    (squares / (values.len() - 1).max(1) as f64).sqrt()
}

/// The interval of what `statistic` makes of the seeds.
pub(super) fn bootstrap(
    seeds: usize,
    rng: &mut impl Rng,
    statistic: impl Fn(&[usize]) -> f64,
) -> Interval {
    let mut values: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let drawn: Vec<usize> = (0..seeds).map(|_| rng.random_range(0..seeds)).collect();
            statistic(&drawn)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    let tail = RESAMPLES / 40;
    [values[tail], values[RESAMPLES - 1 - tail]]
}
