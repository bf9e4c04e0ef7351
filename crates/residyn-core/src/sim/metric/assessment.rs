//! Open-loop errors window by window, horizon by horizon.

use super::summary::root_mean;

/// Squared errors of one window.
#[derive(Debug, Clone, PartialEq)]
pub struct WindowError {
    /// Index of the log.
    pub log: usize,
    /// Time of its first row in s.
    pub start_s: f64,
    /// Rows that were compared.
    pub rows: usize,
    /// Sum over the rows of the squared position error, one per joint.
    pub position: Vec<f64>,
    /// Sum over the rows of the squared velocity error, one per joint.
    pub velocity: Vec<f64>,
    /// The prediction left every sensible range; its state is held at the limit, so that errors stay finite.
    pub diverged: bool,
}

/// All windows of one horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenLoop {
    pub horizon_s: f64,
    pub windows: Vec<WindowError>,
}

/// The error of a model on logs at several horizons.
#[derive(Debug, Clone, PartialEq)]
pub struct Assessment {
    pub horizons: Vec<OpenLoop>,
    /// Length of the integrator's steps in s at which halving them changed no number by more than
    /// 0.1 %, or the shortest that was tried.
    pub step_s: f64,
    /// The largest relative change of a number at the last halving.
    pub step_error: f64,
}

impl Assessment {
    /// The horizon at which models are compared by a single number.
    pub fn middle(&self) -> &OpenLoop {
        &self.horizons[self.horizons.len() / 2]
    }

    /// Position error of all joints together at the middle horizon: root of the mean over rows of the sum over
    /// joints, rad (or m).
    pub fn position_rms(&self) -> f64 {
        root_mean(&self.middle().windows, |window| &window.position)
    }
}
