use std::borrow::Cow;

use crate::model::Dynamics;

/// A model's program at one point of its parameter space: what is simulated. A model stands for the point at its own
/// values; a fit visits other points with the same program.
#[derive(Debug, Clone)]
pub struct Point<'d> {
    pub dynamics: &'d Dynamics,
    values: Cow<'d, [f64]>,
}

impl<'d> Point<'d> {
    /// `dynamics` with other values of its parameters, in its order and units.
    ///
    /// # Panics
    /// When `values` does not have one entry per parameter.
    pub fn new(dynamics: &'d Dynamics, values: impl Into<Cow<'d, [f64]>>) -> Self {
        let values = values.into();
        let expected = dynamics.parameters.len();
        assert_eq!(values.len(), expected, "one value for each parameter");
        Self { dynamics, values }
    }

    /// One value for each parameter.
    pub fn values(&self) -> &[f64] {
        &self.values
    }
}

impl<'p> From<&'p Point<'_>> for Point<'p> {
    fn from(point: &'p Point<'_>) -> Self {
        Self {
            dynamics: point.dynamics,
            values: Cow::Borrowed(&point.values),
        }
    }
}

impl<'d> From<&'d Dynamics> for Point<'d> {
    fn from(dynamics: &'d Dynamics) -> Self {
        Self::new(dynamics, dynamics.values())
    }
}
