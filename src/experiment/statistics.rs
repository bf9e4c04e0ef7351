use rand::{Rng, RngExt};

/// A 95 % confidence interval, by bootstrap over the seeds (Efron 1979).
pub type Interval = [f64; 2];

const RESAMPLES: usize = 2000;

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The sample's standard deviation; 0 for a single value.
pub(crate) fn deviation(values: &[f64]) -> f64 {
    let middle = mean(values);
    let squares: f64 = values.iter().map(|value| (value - middle).powi(2)).sum();
    (squares / (values.len() - 1).max(1) as f64).sqrt()
}

/// The bootstrap interval of a statistic of the seeds, given by their positions.
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

#[cfg(test)]
mod tests {
    use super::{bootstrap, deviation, mean};
    use crate::runs::{Purpose, stream};

    #[test]
    fn intervals_are_those_of_the_normal_distribution_where_samples_are_many() {
        // 0, 1, ..., 999: the mean of so many is normal, with a deviation of 288.8 / sqrt(1000).
        let values: Vec<f64> = (0..1000).map(f64::from).collect();
        assert!((deviation(&values) - 288.8).abs() < 0.1);
        let mut rng = stream(1, Purpose::Other(0));
        let of = |drawn: &[usize]| drawn.iter().map(|k| values[*k]).sum::<f64>() / 1000.0;
        let [low, high] = bootstrap(values.len(), &mut rng, of);
        let half = 1.96 * deviation(&values) / 1000.0_f64.sqrt();
        assert!((mean(&values) - half - low).abs() < 0.1 * half, "{low}");
        assert!((mean(&values) + half - high).abs() < 0.1 * half, "{high}");
        assert_eq!(deviation(&[3.0]), 0.0);
    }
}
