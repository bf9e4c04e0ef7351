//! How far the bodies of a fitted model are off the declared ones, together: each is off by a few percent, but hardly all of
//! them by the same factor.

use super::payload::p_of_departure;
use crate::data::statistics::median_of;
use crate::model::Model;

/// The bodies of a fitted model beside the declared ones.
pub(super) struct BodiesOff {
    bodies: usize,
    /// The logarithms of the ratios to the declared values, of all parts that are free and not declared as zero.
    ratios: Vec<f64>,
}

impl BodiesOff {
    pub fn of(declared: &Model, fitted: &Model) -> Self {
        let ratio = |part: usize| {
            let declared = &declared.parameters[part];
            let ratio = fitted.parameters[part].value / declared.value;
            (!declared.fixed && declared.value != 0.0).then(|| ratio.max(f64::MIN_POSITIVE).ln())
        };
        let bodies = declared.inertias();
        Self {
            bodies: bodies.len(),
            ratios: bodies.into_iter().flatten().filter_map(ratio).collect(),
        }
    }

    /// The logarithm of the factor that they have in common.
    pub fn common(&self) -> f64 {
        median_of(self.ratios.clone())
    }

    /// How far they are off, beside a common factor of which this is the logarithm.
    pub fn beside(&self, common: f64) -> f64 {
        let off = self.ratios.iter().map(|ratio| (ratio - common).abs());
        median_of(off.collect())
    }

    /// The probability that bodies which are off by `more` come out as far nearer as `less` by chance with so many more
    /// values. The declared values are taken for measurements of an unknown spread, one for each body.
    pub fn p_of_nearer(&self, less: f64, more: f64, values: usize) -> f64 {
        let twice = 2.0 * self.bodies as f64 * (more / less.max(f64::MIN_POSITIVE)).ln();
        p_of_departure(twice, values)
    }
}

#[cfg(test)]
mod tests {
    use super::BodiesOff;

    #[test]
    fn bodies_that_are_all_off_by_one_factor_are_not_so_by_chance() {
        let of = |ratios: &[f64]| BodiesOff {
            bodies: 3,
            ratios: ratios.iter().map(|ratio: &f64| ratio.ln()).collect(),
        };
        let p = |bodies: &BodiesOff| {
            let common = bodies.common();
            bodies.p_of_nearer(bodies.beside(common), bodies.beside(0.0), 1)
        };
        let scaled = of(&[0.79, 0.8, 0.81, 0.8, 1.0]);
        assert!((scaled.common().exp() - 0.8).abs() < 1e-12);
        assert!(p(&scaled) < 1e-3);
        assert!(p(&of(&[0.9, 1.05, 1.1, 0.95, 1.0])) > 0.1);
        assert!(
            p(&of(&[-0.8, 0.8, 1.2, 1.0, 1.0])) > 0.1,
            "another sign is no factor"
        );
    }
}
