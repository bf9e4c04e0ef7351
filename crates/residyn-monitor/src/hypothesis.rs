use super::Kind;
use residyn_core::data::Joint;

/// Something that may change, in the direction of one regressor of the residual.
#[derive(Debug, Clone)]
pub(crate) struct Hypothesis {
    pub kind: Kind,
    pub joint: Joint,
    /// The parameter's name.
    pub name: String,
    /// In words: `coulomb friction`.
    pub what: String,
    pub unit: String,
    /// The declared value.
    pub value: f64,
    /// Lowest and highest admissible value.
    pub bounds: [f64; 2],
    /// Standard deviation of the value before any data.
    pub prior: f64,
}

impl Hypothesis {
    /// The largest change that would still be a change of this and not of something else: twice the declared value, or what
    /// is declared as usual.
    pub fn plausible(&self) -> f64 {
        match self.kind {
            Kind::EncoderZero => 0.5,
            _ if self.value != 0.0 => 2.0 * self.value.abs(),
            _ => 50.0 * self.prior,
        }
    }

    /// Whether estimates are given as a share of the declared value.
    pub fn is_relative(&self) -> bool {
        self.kind == Kind::Parameter && self.value != 0.0
    }
}
