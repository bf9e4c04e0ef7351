//! Open-loop position errors, log by log, so that they can be pooled over folds.

use serde::{Deserialize, Serialize};

use residyn_core::closeloop::Settings;
use residyn_core::data::Log;
use residyn_core::data::statistics::{mean, median, standard_error};
use residyn_core::model::Dynamics;
use residyn_core::sim::metric::{Assessment, OpenLoop, assess};

/// The errors of a model on a test log, one for each horizon of
/// [`ScoreSettings`](residyn_core::closeloop::ScoreSettings).
pub type LogErrors = Vec<Squares>;

/// Squared position errors of the windows of one log at one horizon.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Squares {
    /// Sum over rows and joints \[rad^2\].
    pub sum: f64,
    /// Rows times joints.
    pub count: usize,
    /// Root mean square of each window over its rows and all joints \[rad\].
    pub windows: Vec<f64>,
    /// Number of windows in which the model diverged.
    pub diverged: usize,
}

/// The errors of a model on each of several logs.
pub fn errors_on(model: &Dynamics, logs: &[Log]) -> Vec<LogErrors> {
    let horizons_s = Settings::default().score.horizons_s;
    by_log(&assess(model, logs, &horizons_s), logs.len())
}

/// An assessment on `logs` logs, split by log.
pub fn by_log(assessment: &Assessment, logs: usize) -> Vec<LogErrors> {
    let horizons = &assessment.horizons;
    (0..logs)
        .map(|log| {
            horizons
                .iter()
                .map(|horizon| Squares::of(horizon, log))
                .collect()
        })
        .collect()
}

impl Squares {
    fn of(horizon: &OpenLoop, log: usize) -> Self {
        let windows = horizon.windows.iter().filter(|window| window.log == log);
        let windows = windows.map(|window| {
            let count = window.rows * window.position.len();
            Self::of_window(window.position.iter().sum(), count, window.diverged)
        });
        Self::pooled(&windows.collect::<Vec<_>>())
    }

    /// One window: the sum over its rows and joints, and their number.
    pub(super) fn of_window(sum: f64, count: usize, diverged: bool) -> Self {
        let window = Self {
            sum,
            count,
            windows: Vec::new(),
            diverged: usize::from(diverged),
        };
        Self {
            windows: vec![window.rms()],
            ..window
        }
    }

    /// All windows of several `Squares` together.
    pub fn pooled<'s>(all: impl IntoIterator<Item = &'s Self>) -> Self {
        all.into_iter()
            .fold(Self::default(), |mut pooled, squares| {
                pooled.sum += squares.sum;
                pooled.count += squares.count;
                pooled.windows.extend(&squares.windows);
                pooled.diverged += squares.diverged;
                pooled
            })
    }

    /// Root mean square over all rows of all windows and all joints \[rad\]; NaN without a window.
    #[allow(clippy::cast_precision_loss)] // rows are far fewer than 2^52
    pub fn rms(&self) -> f64 {
        (self.sum / self.count as f64).sqrt()
    }

    /// By how many standard errors the squared error of a window is larger than another model's, on average over the
    /// same windows; NaN if they are not the same, or one.
    pub fn above(&self, other: &Self) -> f64 {
        let pairs = self.windows.iter().zip(&other.windows);
        let rises: Vec<f64> = pairs
            .map(|(own, other)| own.powi(2) - other.powi(2))
            .collect();
        match self.windows.len() == other.windows.len() && rises.len() > 1 {
            true => mean(&rises) / standard_error(&rises),
            false => f64::NAN,
        }
    }

    /// Median over the windows of each window's root mean square \[rad\].
    pub fn median(&self) -> f64 {
        median(&self.windows)
    }
}

#[cfg(test)]
mod tests {
    use super::Squares;

    #[test]
    fn errors_are_above_others_by_the_spread_of_their_windows() {
        let of = |windows: [f64; 4]| Squares {
            windows: windows.into(),
            ..Squares::default()
        };
        let (base, above) = (of([1.0, 2.0, 3.0, 4.0]), of([1.1, 2.1, 3.1, 4.1]));
        assert!(above.above(&base) > 3.0 && base.above(&above) < -3.0);
        assert!(of([1.5, 1.5, 3.5, 3.5]).above(&base).abs() < 1.0);
        assert!(Squares::default().above(&base).is_nan());
    }
}
