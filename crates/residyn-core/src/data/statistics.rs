//! Medians, quantiles, spreads and intervals, shared by all modules.
//!
//! Ties and NaN are ordered by [`f64::total_cmp`]. Functions that return 0 for an empty sample say so; the others need
//! at least one value.

use rand::{Rng, RngExt};

/// Standard deviation of a normal distribution per median absolute deviation.
pub(crate) const SIGMA_PER_MAD: f64 = 1.4826;

/// Two-sided 95 % point of the standard normal distribution.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Resamples of a bootstrap: its 95 % interval then ends at the 51st value from either side.
const RESAMPLES: usize = 2000;

/// Arithmetic mean; NaN for no values.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Lowest and highest value; infinite for no values.
pub(crate) fn ends(values: &[f64]) -> [f64; 2] {
    let each = || values.iter().copied();
    let low = each().fold(f64::INFINITY, f64::min);
    [low, each().fold(f64::NEG_INFINITY, f64::max)]
}

/// Root mean square; NaN for no values.
pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Standard deviation of the values as a whole population (divided by n); NaN for no values.
pub(crate) fn deviation(values: &[f64]) -> f64 {
    (squares_about_mean(values) / values.len() as f64).sqrt()
}

/// Standard deviation estimated from a sample (divided by n - 1); 0 for a single value.
pub fn sample_deviation(values: &[f64]) -> f64 {
    sample_variance(values).sqrt()
}

/// Standard error of the mean of a sample; 0 for a single value.
pub fn standard_error(values: &[f64]) -> f64 {
    (sample_variance(values) / values.len() as f64).sqrt()
}

fn sample_variance(values: &[f64]) -> f64 {
    squares_about_mean(values) / (values.len() as f64 - 1.0).max(1.0)
}

fn squares_about_mean(values: &[f64]) -> f64 {
    let mean = mean(values);
    values.iter().map(|value| (value - mean).powi(2)).sum()
}

/// The middle value, or the mean of the two middle ones; 0 for no values.
pub fn median(values: &[f64]) -> f64 {
    median_of(values.to_vec())
}

/// [`median`] of values whose order need not be kept.
pub(crate) fn median_of(mut values: Vec<f64>) -> f64 {
    let (half, even) = (values.len() / 2, values.len().is_multiple_of(2));
    if values.is_empty() {
        return 0.0;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    match below.iter().copied().max_by(f64::total_cmp) {
        Some(lower) if even => (lower + upper) / 2.0,
        _ => upper,
    }
}

/// The middle value, or the upper of the two middle ones: the robust scale of a fit, where their mean would cost a
/// second pass and say no more. 0 for no values.
pub(crate) fn upper_median(values: &[f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    nth(values, values.len() / 2)
}

/// Median absolute deviation from the median; 0 for no values.
pub(crate) fn mad(values: &[f64]) -> f64 {
    let centre = median(values);
    median_of(values.iter().map(|value| (value - centre).abs()).collect())
}

/// The value at the place nearest to `share` (0 to 1) of the way from the lowest to the highest; 0 for no values.
pub fn quantile(values: &[f64], share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let place = (share * (values.len() - 1) as f64).round() as usize;
    nth(values, place)
}

/// The lowest value that at least a `share` (0 to 1) of the values do not exceed (type 1 of Hyndman and Fan 1996); 0
/// for no values.
pub fn rank_quantile(values: &[f64], share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let rank = (share * values.len() as f64).ceil() as usize;
    nth(values, rank.max(1) - 1)
}

/// Lower quartile, median and upper quartile, linear between neighbours (type 7 of Hyndman and Fan 1996).
pub fn quartiles(values: &[f64]) -> [f64; 3] {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let last = values.len() - 1;
    [1, 2, 3].map(|quarters| {
        let (below, share) = (quarters * last / 4, (quarters * last % 4) as f64 / 4.0);
        let above = values[(below + 1).min(last)];
        values[below] + share * (above - values[below])
    })
}

/// The value that would stand at a place, from 0, if the values were sorted; there has to be one.
fn nth(values: &[f64], place: usize) -> f64 {
    *values
        .to_vec()
        .select_nth_unstable_by(place, f64::total_cmp)
        .1
}

/// 95 % interval of a statistic of `count` cases, by drawing as many with replacement, 2000 times (percentile bootstrap,
/// Efron 1979). `statistic` gets the indices drawn.
pub fn bootstrap(
    count: usize,
    rng: &mut impl Rng,
    statistic: impl Fn(&[usize]) -> f64,
) -> [f64; 2] {
    let mut drawn = vec![0; count];
    let mut values: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            drawn.fill_with(|| rng.random_range(0..count));
            statistic(&drawn)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    let tail = RESAMPLES / 40;
    [values[tail], values[RESAMPLES - 1 - tail]]
}

/// 95 % interval of a probability from `hits` in `trials` (Wilson 1927); 0 to 1 without a trial.
pub fn wilson(hits: usize, trials: usize) -> [f64; 2] {
    if trials == 0 {
        return [0.0, 1.0];
    }
    let (n, z2) = (trials as f64, NORMAL_95 * NORMAL_95);
    let p = hits as f64 / n;
    let middle = (p + 0.5 * z2 / n) / (1.0 + z2 / n);
    let half = NORMAL_95 / (1.0 + z2 / n) * (p * (1.0 - p) / n + 0.25 * z2 / (n * n)).sqrt();
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn medians_and_quantiles() {
        assert_eq!(median(&[]), 0.0);
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(upper_median(&[4.0, 1.0, 2.0, 3.0]), 3.0);
        assert_eq!(upper_median(&[]), 0.0);
        assert_eq!(quantile(&[5.0, 1.0, 3.0], 1.0), 5.0);
        assert_eq!(quantile(&[], 0.5), 0.0);
        assert_eq!(mad(&[1.0, 1.0, 2.0, 100.0, 1.0]), 0.0);
    }

    #[test]
    fn rank_quantiles_are_values_that_occur() {
        let values = [3.0, 1.0, 2.0, 4.0];
        assert_eq!(
            [0.0, 0.5, 0.9, 1.0].map(|share| rank_quantile(&values, share)),
            [1.0, 2.0, 4.0, 4.0]
        );
        assert_eq!(rank_quantile(&[], 0.5), 0.0);
    }

    #[test]
    fn quartiles_lie_between_neighbours() {
        assert_eq!(quartiles(&[3.0]), [3.0; 3]);
        assert_eq!(quartiles(&[4.0, 1.0, 2.0, 3.0]), [1.75, 2.5, 3.25]);
    }

    #[test]
    fn deviations_divide_by_the_count_or_by_one_less() {
        let values = [1.0, 3.0];
        assert_eq!(deviation(&values), 1.0);
        assert_eq!(sample_deviation(&values), 2.0_f64.sqrt());
        assert_eq!(standard_error(&values), 1.0);
        assert_eq!(sample_deviation(&[3.0]), 0.0);
    }

    #[test]
    fn intervals_are_those_of_the_normal_distribution_where_samples_are_many() {
        // 0, 1, ..., 999: the mean of this many is normal, with a deviation of 288.8 / sqrt(1000).
        let values: Vec<f64> = (0..1000).map(f64::from).collect();
        assert!((sample_deviation(&values) - 288.8).abs() < 0.1);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let of = |drawn: &[usize]| drawn.iter().map(|k| values[*k]).sum::<f64>() / 1000.0;
        let [low, high] = bootstrap(values.len(), &mut rng, of);
        let half = 1.96 * sample_deviation(&values) / 1000.0_f64.sqrt();
        assert!((mean(&values) - half - low).abs() < 0.1 * half, "{low}");
        assert!((mean(&values) + half - high).abs() < 0.1 * half, "{high}");
    }

    #[test]
    fn wilson_intervals_are_those_of_the_formula() {
        // Newcombe 1998, table I: 81 of 263 and 0 of 20. 5 of 10 as printed in textbooks.
        let [low, high] = wilson(81, 263);
        assert!((low - 0.2553).abs() < 5e-5 && (high - 0.3662).abs() < 5e-5);
        let [low, high] = wilson(0, 20);
        assert!(low == 0.0 && (high - 0.16113).abs() < 1e-5, "{high}");
        let [low, high] = wilson(5, 10);
        assert!((low - 0.2366).abs() < 1e-4 && (high - 0.7634).abs() < 1e-4);
        assert_eq!(wilson(0, 0), [0.0, 1.0]);
    }
}
