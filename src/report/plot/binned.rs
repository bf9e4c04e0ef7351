//! The mean course of a cloud of points.

/// Fewer points than this do not give a spread worth drawing.
const MIN_PER_BIN: usize = 5;

/// Mean of the points whose x lies between two quantiles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bin {
    /// Mean of x.
    pub x: f64,
    /// Mean of y.
    pub mean: f64,
    /// Half the width of the 95 % interval of `mean`, from Student's t. It takes the points as independent, so
    /// points from overlapping windows make it too narrow.
    pub half_width: f64,
    /// Number of points.
    pub count: usize,
}

/// Cuts the finite points into at most `bins` bins of equal number along x and averages each.
///
/// Equal x are never parted, so a variable that stays constant gives one bin; a bin holds at least five points,
/// so that fewer points give fewer bins, and fewer than five none.
pub fn binned_mean(points: &[(f64, f64)], bins: usize) -> Vec<Bin> {
    let mut sorted: Vec<_> = points
        .iter()
        .copied()
        .filter(|(x, y)| x.is_finite() && y.is_finite())
        .collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = sorted.len().div_ceil(bins.max(1)).max(MIN_PER_BIN);
    let mut rest = sorted.as_slice();
    let mut means = Vec::new();
    while rest.len() >= MIN_PER_BIN {
        let (head, tail) = rest.split_at(cut(rest, size));
        means.push(mean_of(head));
        rest = tail;
    }
    means
}

/// Where the first bin of `rest` ends: after `size` points, moved past equal x and past a tail too short to stand
/// alone.
fn cut(rest: &[(f64, f64)], size: usize) -> usize {
    if rest.len() <= size {
        return rest.len();
    }
    let edge = rest[size - 1].0;
    let end = size + rest[size..].partition_point(|point| point.0 <= edge);
    if rest.len() - end < MIN_PER_BIN {
        rest.len()
    } else {
        end
    }
}

fn mean_of(points: &[(f64, f64)]) -> Bin {
    let count = points.len();
    let n = count as f64;
    let x = points.iter().map(|point| point.0 / n).sum();
    let mean: f64 = points.iter().map(|point| point.1 / n).sum();
    let squares: f64 = points.iter().map(|point| (point.1 - mean).powi(2)).sum();
    let half_width = t_975(n - 1.0) * (squares / (n - 1.0) / n).sqrt();
    Bin {
        x,
        mean,
        half_width,
        count,
    }
}

/// 97.5 % quantile of Student's t, from the normal quantile: Abramowitz and Stegun 26.7.5, to four terms, within
/// 0.1 % at the four degrees of freedom that the smallest bin has.
fn t_975(freedom: f64) -> f64 {
    let z: f64 = 1.959_963_984_540_054;
    let terms = [
        (z.powi(3) + z) / 4.0,
        (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0,
        (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0,
        (79.0 * z.powi(9) + 776.0 * z.powi(7) + 1482.0 * z.powi(5)
            - 1920.0 * z.powi(3)
            - 945.0 * z)
            / 92_160.0,
    ];
    let series = terms
        .iter()
        .rev()
        .fold(0.0, |sum, term| (sum + term) / freedom);
    z + series
}

#[cfg(test)]
mod tests {
    use super::{binned_mean, t_975};

    fn line(count: i32) -> Vec<(f64, f64)> {
        (0..count)
            .map(|i| (f64::from(i), 2.0 * f64::from(i)))
            .collect()
    }

    #[test]
    fn every_point_is_in_one_bin() {
        for count in 5..200 {
            let bins = binned_mean(&line(count), 12);
            assert_eq!(
                bins.iter().map(|bin| bin.count).sum::<usize>(),
                count as usize
            );
            assert!(bins.len() <= 12 && bins.iter().all(|bin| bin.count >= 5));
        }
    }

    #[test]
    fn means_follow_a_line() {
        for bin in binned_mean(&line(120), 12) {
            assert_eq!(bin.count, 10);
            assert!((bin.mean - 2.0 * bin.x).abs() < 1e-9);
        }
    }

    #[test]
    fn half_width_is_that_of_student() {
        let bins = binned_mean(
            &[(0.0, 1.0), (0.0, 2.0), (0.0, 3.0), (0.0, 4.0), (0.0, 5.0)],
            3,
        );
        let expected = 2.776_445 * (2.5_f64 / 5.0).sqrt();
        assert!((bins[0].half_width / expected - 1.0).abs() < 1e-3);
        assert!((t_975(30.0) - 2.042_272).abs() < 1e-4);
    }

    #[test]
    fn equal_x_are_not_parted() {
        let mut points = vec![(0.0, 1.0); 50];
        points.extend(vec![(1.0, 3.0); 7]);
        let bins = binned_mean(&points, 10);
        assert_eq!(bins.len(), 2);
        assert_eq!((bins[0].count, bins[1].count), (50, 7));
    }

    #[test]
    fn too_few_or_unusable_points_give_no_bin() {
        assert!(binned_mean(&[], 10).is_empty());
        assert!(binned_mean(&line(4), 10).is_empty());
        assert!(binned_mean(&[(f64::NAN, 1.0); 20], 10).is_empty());
        assert_eq!(binned_mean(&line(6), 0).len(), 1);
    }
}
