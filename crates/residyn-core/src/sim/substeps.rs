//! How finely motion is integrated; all step lengths in s.

use super::scheme::{STABILISED_RK3, Scheme};
use crate::lanes::Row;

/// By which scheme motion is integrated, and in substeps of at most which length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steps {
    pub scheme: &'static Scheme,
    /// s
    pub longest_s: f64,
}

impl Steps {
    /// Of fits, where friction does not need shorter ones.
    pub const FIT: Self = Self {
        scheme: STABILISED_RK3,
        longest_s: FIT_S,
    };

    /// The same in substeps of at most this length.
    #[must_use]
    pub fn at_most(self, longest_s: f64) -> Self {
        Self {
            longest_s: longest_s.min(self.longest_s),
            ..self
        }
    }
}

/// In fits, and in motions designed for them: at 2 ms Runge-Kutta methods are accurate, and stable with dry friction smoothed to
/// a fraction of a percent of the top speed.
pub const FIT_S: f64 = 2e-3;
/// In the final estimate of a model that has been chosen.
pub const FINE_FIT_S: f64 = 5e-4;
/// In the first integration of an open-loop error, whose steps are then halved until it no longer changes, and in
/// pictures of predictions.
pub const PREDICTION_S: f64 = 1e-3;
/// In simulated rigs: far below what any fit uses, so that no model fits them by sharing their integration error.
pub const RIG_S: f64 = 1e-4;

/// Rounding of times may make a step exceed a whole number of longest substeps by this much: Unix time stamps are a
/// quarter of a microsecond apart.
const ROUNDING_S: f64 = 2.5e-7;

/// How many equal substeps of at most `longest_s` each of these steps needs, one number for all lanes.
pub fn substeps<const W: usize>(lengths: &Row<f64, W>, longest_s: f64) -> usize {
    let longest = lengths.iter().fold(0.0_f64, |a, b| a.max(*b));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small positive number
    let count = ((longest - ROUNDING_S) / longest_s).ceil() as usize;
    count.max(1)
}

#[cfg(test)]
mod tests {
    use super::substeps;
    use crate::lanes::Row;

    #[test]
    fn the_longest_lane_counts_and_rounding_does_not() {
        assert_eq!(substeps(&Row([0.0]), 1e-3), 1);
        assert_eq!(substeps(&Row([0.001, 0.0021]), 1e-3), 3);
        // By rounding 0.8 - 0.7 is above 0.1, and 0.3 - 0.2 below.
        for length in [0.8 - 0.7, 0.3 - 0.2] {
            assert_eq!(substeps(&Row([length]), 1e-3), 100);
        }
    }
}
