use serde::Serialize;

use super::assessment::{OpenLoop, WindowError};
use crate::data::statistics::median;

/// The numbers of an assessment, `[horizon][joint]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    pub horizons_s: Vec<f64>,
    /// Root mean square over all rows of all windows, rad (or m).
    pub position_rmse: Vec<Vec<f64>>,
    /// Median over the windows of the root mean square per window, rad (or m).
    pub position_median: Vec<Vec<f64>>,
    /// As `position_rmse`, rad/s (or m/s), against the logged velocity.
    pub velocity_rmse: Vec<Vec<f64>>,
    pub windows: Vec<usize>,
    /// Number of windows in which the prediction diverged.
    pub diverged: Vec<usize>,
}

/// Summarise the windows of each horizon. A horizon without windows has zero errors and a window count of zero.
pub fn summarise(horizons: &[OpenLoop], joints: usize) -> Summary {
    let per_joint = |f: &dyn Fn(&OpenLoop, usize) -> f64| -> Vec<Vec<f64>> {
        horizons
            .iter()
            .map(|horizon| (0..joints).map(|j| f(horizon, j)).collect())
            .collect()
    };
    Summary {
        horizons_s: horizons.iter().map(|horizon| horizon.horizon_s).collect(),
        position_rmse: per_joint(&|horizon, j| root_mean(&horizon.windows, |w| &w.position[j..=j])),
        position_median: per_joint(&|horizon, j| {
            let of_window = |w| root_mean(std::slice::from_ref(w), |w| &w.position[j..=j]);
            median(&horizon.windows.iter().map(of_window).collect::<Vec<_>>())
        }),
        velocity_rmse: per_joint(&|horizon, j| root_mean(&horizon.windows, |w| &w.velocity[j..=j])),
        windows: horizons.iter().map(|of| of.windows.len()).collect(),
        diverged: (horizons.iter())
            .map(|of| of.windows.iter().filter(|w| w.diverged).count())
            .collect(),
    }
}

/// The root of the sum of squares, several per window, over the number of rows.
pub(super) fn root_mean(windows: &[WindowError], squares: impl Fn(&WindowError) -> &[f64]) -> f64 {
    let rows: usize = windows.iter().map(|w| w.rows).sum();
    #[allow(clippy::cast_precision_loss)] // rows are far fewer than 2^52
    let rows = rows.max(1) as f64;
    (windows.iter().flat_map(squares).sum::<f64>() / rows).sqrt()
}
