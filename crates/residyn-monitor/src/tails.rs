//! Thresholds: the value that a statistic exceeds with a given probability while nothing has changed.

use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

/// The square of a Student's t with these degrees of freedom is above it with probability `p`.
pub(crate) fn t_squared(p: f64, freedom: f64) -> f64 {
    let t = StudentsT::new(0.0, 1.0, freedom).expect("degrees of freedom are positive");
    crossing(|x| 2.0 * t.sf(x.sqrt()), p)
}

/// Hotelling's T squared of `k` variables, whose covariance comes from `blocks`, is above it with probability `p`.
pub(crate) fn hotelling(p: f64, k: usize, blocks: f64) -> f64 {
    let k = k as f64;
    let left = (blocks - k).max(2.0);
    let f = FisherSnedecor::new(k, left).expect("degrees of freedom are positive");
    crossing(|x| f.sf(x), p) * k * (left + k - 1.0) / left
}

/// Where a falling probability crosses `p`, to one part in a million.
fn crossing(above: impl Fn(f64) -> f64, p: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while above(high) > p && high < 1e12 {
        high *= 2.0;
    }
    while high - low > 1e-6 * high {
        let middle = 0.5 * (low + high);
        match above(middle) > p {
            true => low = middle,
            false => high = middle,
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::{hotelling, t_squared};

    #[test]
    fn thresholds_are_those_of_printed_tables() {
        // t of 10 degrees of freedom, two-sided 5 %: 2.228; F(3, 10) at 5 %: 3.708.
        assert!((t_squared(0.05, 10.0).sqrt() - 2.228).abs() < 1e-3);
        assert!((hotelling(0.05, 3, 13.0) / (3.0 * 12.0 / 10.0) - 3.708).abs() < 2e-3);
        // One variable: both are the same.
        assert!((t_squared(1e-7, 30.0) / hotelling(1e-7, 1, 31.0) - 1.0).abs() < 1e-4);
    }
}
