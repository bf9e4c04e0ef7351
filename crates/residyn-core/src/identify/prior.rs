use super::normal_equations::WindowTerms;
use super::values::{Column, Values};
use crate::model::Model;
use crate::model::tree::{Divergence, PARTS};

/// What is known of a model's values apart from the logs: that the declared ones are of the right size. Of all values
/// with which a model explains the logs equally well, the fit finds those nearest to the declared ones.
///
/// The cost of a value is half the square of its departure, which grows as the logarithm of its ratio to the declared
/// one if they differ much, and stays finite if the value changes sign.
#[derive(Debug, Clone, Default)]
pub(super) struct Prior {
    /// Declared values that are not part of a body; none is zero.
    declared: Vec<Declared>,
    bodies: Vec<DeclaredBody>,
}

#[derive(Debug, Clone)]
struct Declared {
    parameter: usize,
    value: f64,
}

/// A body's values are physical, and near the declared ones.
#[derive(Debug, Clone)]
struct DeclaredBody {
    /// The model's parameters, in the order of the parts.
    parameters: [usize; PARTS],
    /// From the declared values.
    divergence: Divergence,
}

/// A ratio to the declared value counts as small below one over this: zero departs as far from it as a tenfold value
/// does.
const STEEPNESS: f64 = 5.0;

impl Declared {
    /// About the logarithm of the ratio, 0 at a ratio of 1; and its slope.
    fn prior_cost(&self, value: f64) -> (f64, f64) {
        let ratio = STEEPNESS * value / self.value;
        let slope = STEEPNESS / self.value / (1.0 + ratio * ratio).sqrt();
        (ratio.asinh() - STEEPNESS.asinh(), slope)
    }
}

impl Prior {
    /// Values are near those declared.
    pub fn near(model: &Model) -> Self {
        // Effects in the file are declared as well, except for their per-log values.
        let all = model.all_parameters();
        let value = |parameter: usize| all[parameter].value;
        let body = |parameters: [usize; PARTS]| {
            let divergence = Divergence::from_nearest_body(&parameters.map(value))?;
            Some(DeclaredBody {
                parameters,
                divergence,
            })
        };
        let bodies: Vec<DeclaredBody> = model.inertias().into_iter().filter_map(body).collect();
        let is_of_body = |parameter: &usize| {
            let mut parts = bodies.iter().flat_map(|body| &body.parameters);
            parts.any(|part| part == parameter)
        };
        let is_known = |p: &usize| value(*p) != 0.0 && !all[*p].per_log && !is_of_body(p);
        let known = (0..all.len()).filter(is_known);
        let declared = known.map(|parameter| Declared {
            parameter,
            value: value(parameter),
        });
        Self {
            declared: declared.collect(),
            bodies,
        }
    }

    /// The bodies of which a fit may change a part, with their parts and the places of the parts among its columns.
    fn free_bodies<'a>(
        &'a self,
        columns: &'a [Column],
        values: &'a Values,
    ) -> impl Iterator<Item = (&'a DeclaredBody, [f64; PARTS], [Option<usize>; PARTS])> + 'a {
        self.bodies.iter().filter_map(|body| {
            let place = |parameter: usize| columns.iter().position(|c| c.parameter == parameter);
            let places = body.parameters.map(place);
            let parts = body.parameters.map(|parameter| values.common[parameter]);
            places
                .iter()
                .any(Option::is_some)
                .then_some((body, parts, places))
        })
    }

    /// The departures of free values: which of `columns`, how far, and the slope.
    fn prior_costs<'a>(
        &'a self,
        columns: &'a [Column],
        values: &'a Values,
    ) -> impl Iterator<Item = (usize, f64, f64)> + 'a {
        columns.iter().enumerate().filter_map(|(i, &column)| {
            let is_it = |declared: &&Declared| declared.parameter == column.parameter;
            let declared = self.declared.iter().find(is_it)?;
            let (prior_cost, slope) = declared.prior_cost(values.get(column));
            Some((i, prior_cost, slope))
        })
    }

    /// The cost of free values, if the declared values say as much as `residuals` residuals.
    pub fn cost(&self, columns: &[Column], values: &Values, residuals: f64) -> f64 {
        let prior_costs = self.prior_costs(columns, values);
        let of_values = 0.5 * prior_costs.map(|(_, d, _)| d * d).sum::<f64>();
        let bodies = self.free_bodies(columns, values);
        let of_bodies: f64 = bodies
            .map(|(body, parts, _)| body.divergence.of(&parts))
            .sum();
        residuals * (of_values + of_bodies)
    }

    /// Its gradient and Gauss-Newton matrix.
    pub fn terms(&self, columns: &[Column], values: &Values, residuals: f64) -> WindowTerms {
        let mut terms = WindowTerms::zeros(columns.len());
        for (i, prior_cost, slope) in self.prior_costs(columns, values) {
            terms.gradient[i] = residuals * prior_cost * slope;
            terms.hessian[(i, i)] = residuals * slope * slope;
        }
        let bodies = self.terms_of_bodies(columns, values, residuals);
        terms.gradient += bodies.gradient;
        terms.hessian += bodies.hessian;
        terms
    }

    /// The bodies' part of the terms, with its cost.
    pub fn terms_of_bodies(
        &self,
        columns: &[Column],
        values: &Values,
        residuals: f64,
    ) -> WindowTerms {
        let mut terms = WindowTerms::zeros(columns.len());
        for (body, parts, places) in self.free_bodies(columns, values) {
            let Some((gradient, hessian)) = body.divergence.terms(&parts) else {
                continue;
            };
            terms.cost += residuals * body.divergence.of(&parts);
            let free = || (0..PARTS).filter_map(|k| Some((k, places[k]?)));
            for (k, row) in free() {
                terms.gradient[row] += residuals * gradient[k];
                for (l, column) in free() {
                    terms.hessian[(row, column)] += residuals * hessian[(k, l)];
                }
            }
        }
        terms
    }
}

#[cfg(test)]
mod tests {

    use super::{Prior, WindowTerms};
    use crate::identify::{Column, Values};
    use crate::model::{Library, Model};

    fn pendulum() -> Model {
        Library::built_in().model("pendulum").unwrap()
    }

    fn columns() -> [Column; 2] {
        let of_all_logs = |parameter| Column {
            parameter,
            log: None,
        };
        [0, 1].map(of_all_logs)
    }

    fn at(common: [f64; 2]) -> Values {
        Values {
            common: common.to_vec(),
            own: Vec::new(),
        }
    }

    #[test]
    fn a_value_costs_more_the_farther_it_is_from_the_declared_one() {
        let prior = Prior::near(&pendulum());
        let declared = pendulum().values();
        let at_ratio = |ratio: f64| at([declared[0] * ratio, declared[1]]);
        let cost = |ratio: f64| prior.cost(&columns(), &at_ratio(ratio), 2.0);
        assert_eq!(cost(1.0), 0.0);
        // Up and down by a factor cost about the square of its logarithm.
        assert!((cost(5.0).sqrt() - 5.0_f64.ln()).abs() < 0.05);
        assert!((cost(0.2).sqrt() - 5.0_f64.ln()).abs() < 0.2);
        assert!(cost(0.0) < cost(20.0) && cost(-1.0) > cost(0.0) && cost(-1.0).is_finite());
    }

    #[test]
    fn its_gradient_is_that_of_the_cost() {
        let prior = Prior::near(&pendulum());
        let WindowTerms {
            gradient, hessian, ..
        } = prior.terms(&columns(), &at([7.0, -1.0]), 3.0);
        let h = 1e-6;
        let moved = |by: f64| prior.cost(&columns(), &at([7.0 + by, -1.0]), 3.0);
        let slope = (moved(h) - moved(-h)) / (2.0 * h);
        assert!(
            (gradient[0] - slope).abs() < 1e-6,
            "{} {slope}",
            gradient[0]
        );
        assert_eq!(hessian[(0, 1)], 0.0);
        assert!(hessian[(0, 0)] > 0.0 && hessian[(1, 1)] > 0.0);
    }
}
