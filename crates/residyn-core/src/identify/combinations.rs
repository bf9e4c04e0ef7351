//! Which combinations of the bodies' parameters the logs determine: base parameters (Gautier 1991), found from the
//! information in a fit, so that combinations that the motion does not excite are left out, as well as those that no
//! motion could determine.

use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::intervals::Uncertainty;
use super::normal_equations::submatrix;
use super::outcome::Fit;
use super::sensitivity::{LANES, Local, Tangent};
use super::values::{Column, Values};
use crate::lanes::Row;
use crate::model::tree::PARTS;
use crate::model::{Dynamics, Model, Parameter};

/// A body's parameter together with the parameters that affect the torques of these logs in the same way.
#[derive(Debug, Clone, PartialEq)]
pub struct Combination {
    /// Number of the first body in it, 0 next to the base.
    pub body: usize,
    /// Parameters and their weights in the sum; the first weight is 1.
    pub parts: Vec<(String, f64)>,
    /// Unit of the first parameter and of the sum.
    pub unit: String,
    /// The sum of the declared values.
    pub declared: f64,
    /// The sum of the fitted values.
    pub value: f64,
    pub ci95: [f64; 2],
}

/// A parameter is distinguished if the logs alone give it a standard deviation below its body's magnitude of its kind:
/// at least this much information, in units of that magnitude.
const IDENTIFIABLE: f64 = 1.0;
/// It is not if its information is smaller than this share of what it has alone: then it is rounding error.
const ROUNDING: f64 = 1e-9;
/// Parameters that change a sum by less than this share of the body's magnitude of the first parameter's kind are not
/// listed.
const LISTED: f64 = 0.02;

/// What logs determine of a chain's bodies.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct IdentifiableBodies {
    /// The sums that they determine, body by body from the base to the tip.
    pub identifiable: Vec<Combination>,
    /// How many sums any motion could determine.
    pub identifiable_at_most: usize,
}

/// The bodies of a fit's model, and which of its columns belong to them.
struct Columns<'a> {
    fit: &'a Fit,
    dynamics: &'a Dynamics,
    /// Body and part of each column that belongs to a body.
    places: Vec<Option<(usize, usize)>>,
    sizes: Vec<[f64; PARTS]>,
}

impl<'a> Columns<'a> {
    fn of(fit: &'a Fit, dynamics: &'a Dynamics, declared: &Model) -> Self {
        let bodies = declared.inertias();
        let place = |column: &Column| {
            let of = |body: &[usize; PARTS]| body.iter().position(|p| *p == column.parameter);
            let mut bodies = (0..).zip(&bodies);
            bodies.find_map(|(b, body)| Some((b, of(body)?)))
        };
        Self {
            fit,
            dynamics,
            places: fit.columns.iter().map(place).collect(),
            sizes: bodies.iter().map(|body| sizes(declared, body)).collect(),
        }
    }

    /// The body's magnitude of the column's kind, or the scale of a value that belongs to no body.
    fn magnitude(&self, column: usize) -> f64 {
        let parameter = self.fit.columns[column].parameter;
        self.places[column].map_or(self.dynamics.parameters[parameter].scale, |(body, part)| {
            self.sizes[body][part]
        })
    }

    /// In units of the magnitudes.
    fn relative(&self, information: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(information.nrows(), information.ncols(), |i, j| {
            information[(i, j)] * self.magnitude(i) * self.magnitude(j)
        })
    }

    /// An identifiable column and the columns of bodies that join it in a sum, with their weights in the columns'
    /// units.
    fn joined(&self, weights: &Weights, row: usize, first: usize) -> Vec<(usize, f64)> {
        let others = weights.others.iter().enumerate();
        let joins = others
            .map(|(k, other)| (*other, weights.of[(row, k)]))
            .filter(|(other, weight)| self.places[*other].is_some() && weight.abs() > LISTED)
            .map(|(other, weight)| {
                let unit = self.magnitude(first) / self.magnitude(other);
                (other, weight * unit)
            });
        [(first, 1.0)].into_iter().chain(joins).collect()
    }

    /// The sum of these columns; `None` for a sum without a body or with an effect's parameter, which has no declared
    /// value.
    fn sum(
        &self,
        weighed: &[(usize, f64)],
        (declared, found): (&Model, &Values),
        uncertainty: &Uncertainty,
    ) -> Option<Combination> {
        let (first, _) = weighed[0];
        let (body, _) = weighed.iter().find_map(|(i, _)| self.places[*i])?;
        let declared: Option<f64> = (weighed.iter())
            .map(|(i, weight)| {
                let parameter = declared.parameters.get(self.fit.columns[*i].parameter)?;
                Some(weight * parameter.value)
            })
            .sum();
        let fitted = |(i, weight): &(usize, f64)| weight * found.get(self.fit.columns[*i]);
        let value: f64 = weighed.iter().map(fitted).sum();
        let half_width = uncertainty.half_width_of(weighed);
        let named = |(i, weight): &(usize, f64)| (self.parameter(*i).name.clone(), *weight);
        Some(Combination {
            body,
            parts: weighed.iter().map(named).collect(),
            unit: self.parameter(first).unit.clone(),
            declared: declared?,
            value,
            ci95: [value - half_width, value + half_width],
        })
    }

    /// The columns of the declared equations outside any body, those of each body, and those of effects: a load at the
    /// tip is determined given the bodies, not the bodies given the load.
    fn groups(&self, declared: &Model) -> Vec<Vec<usize>> {
        let end = declared.parameters.len();
        let rank = |column: usize| match self.places[column] {
            Some((body, _)) => 1 + body,
            None if self.fit.columns[column].parameter < end => 0,
            None => 1 + self.sizes.len(),
        };
        let all = 0..self.places.len();
        let group = |of: usize| all.clone().filter(|column| rank(*column) == of).collect();
        (0..self.sizes.len() + 2).map(group).collect()
    }

    fn parameter(&self, column: usize) -> &Parameter {
        &self.dynamics.parameters[self.fit.columns[column].parameter]
    }
}

/// What the logs of a fit to torques determine of its model's bodies; empty for a model whose bodies are fixed, or that
/// has none.
pub fn identifiable_bodies(
    dynamics: &Dynamics,
    declared: &Model,
    found: &Values,
    fit: &Fit,
    uncertainty: &Uncertainty,
) -> IdentifiableBodies {
    let columns = Columns::of(fit, dynamics, declared);
    if columns.places.iter().all(Option::is_none) {
        return IdentifiableBodies::default();
    }
    let relative = columns.relative(&fit.equations().hessian);
    let identifiable = distinguished(&relative, &columns.groups(declared), IDENTIFIABLE);
    let Some(weights) = weights(&relative, &identifiable) else {
        return IdentifiableBodies::default();
    };
    let sum = |(row, &first): (usize, &usize)| {
        let weighed = columns.joined(&weights, row, first);
        columns.sum(&weighed, (declared, found), uncertainty)
    };
    let mut identifiable: Vec<Combination> =
        identifiable.iter().enumerate().filter_map(sum).collect();
    identifiable.sort_by_key(|combination| combination.body);
    IdentifiableBodies {
        identifiable,
        identifiable_at_most: identifiable_at_most(&columns),
    }
}

/// Number of rows of random states.
const ROWS: usize = 64;

/// How many sums of the bodies' parameters show in the torques of random states.
fn identifiable_at_most(columns: &Columns<'_>) -> usize {
    let is_of_body = |i: &usize| columns.places[*i].is_some();
    let own: Vec<usize> = (0..columns.places.len()).filter(is_of_body).collect();
    let parameters = own.iter().map(|i| columns.fit.columns[*i].parameter);
    let active: Vec<usize> = parameters.collect();
    let tangent = Tangent::new(columns.dynamics, &active, Local::Nothing);
    let values = columns.dynamics.values();
    let mut tape = (tangent.program).tape_at::<f64, LANES>(tangent.first_parameter, &values);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    // For all columns: zero for those that belong to no body.
    let mut information = DMatrix::<f64>::zeros(columns.places.len(), columns.places.len());
    for _ in 0..ROWS {
        for slot in tape.moving() {
            *slot = Row::from_fn(|_| StandardNormal.sample(&mut rng));
        }
        tape.run();
        for (places, outputs) in tangent.slopes() {
            let slopes = || places.iter().zip(outputs.clone());
            for (row, by_row) in slopes() {
                for (column, by_column) in slopes() {
                    let [a, b] = [by_row, by_column].map(|output| tape.output(output));
                    let product: f64 = (0..LANES).map(|lane| a[lane] * b[lane]).sum();
                    information[(own[*row], own[*column])] += product;
                }
            }
        }
    }
    distinguished(&columns.relative(&information), &[own], 0.0).len()
}

/// A body's magnitude of each kind: mass, mass times radius of gyration, and mass times that radius squared.
pub fn sizes(declared: &Model, body: &[usize; PARTS]) -> [f64; PARTS] {
    let value = |part: usize| declared.parameters[body[part]].value.abs();
    let (mass, trace) = (value(0), value(4) + value(7) + value(9));
    std::array::from_fn(|part| match part {
        0 => mass,
        1..4 => (mass * trace).sqrt(),
        _ => trace,
    })
}

/// Columns that are distinguished, with at least this information; the first group before the next, and in each group
/// the best determined column first.
pub fn distinguished(relative: &DMatrix<f64>, groups: &[Vec<usize>], least: f64) -> Vec<usize> {
    let mut left = relative.clone();
    let mut identifiable = Vec::new();
    for group in groups {
        let mut open = group.clone();
        while let Some(at) = (0..open.len()).max_by(|a, b| {
            let information = |k: usize| left[(open[k], open[k])];
            information(*a).total_cmp(&information(*b))
        }) {
            let next = open.swap_remove(at);
            let information = left[(next, next)];
            let rounding = ROUNDING * relative[(next, next)];
            if !(information > rounding.max(least)) {
                break;
            }
            let row = left.row(next).clone_owned();
            left -= row.transpose() * &row / information;
            identifiable.push(next);
        }
    }
    identifiable
}

/// By how much each identifiable column stands for the others.
#[derive(Debug, Clone)]
pub struct Weights {
    pub others: Vec<usize>,
    /// In units of the magnitudes, one row per identifiable column and one column per other one.
    pub of: DMatrix<f64>,
}

/// The sums that identifiable columns stand for, by the information in units of the magnitudes; `None` if it is not
/// positive definite.
pub fn weights(relative: &DMatrix<f64>, identifiable: &[usize]) -> Option<Weights> {
    let others: Vec<usize> = (0..relative.nrows())
        .filter(|i| !identifiable.contains(i))
        .collect();
    let known = submatrix(relative, identifiable, identifiable);
    let cross = submatrix(relative, identifiable, &others);
    Some(Weights {
        of: known.cholesky()?.solve(&cross),
        others,
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::{distinguished, weights};

    /// Three values, the second and third of which enter only as b + 2 c, and one that does not show.
    #[test]
    fn what_enters_as_a_sum_is_told_as_a_sum() {
        let rows = DMatrix::from_row_slice(
            3,
            4,
            &[
                9.0, 1.0, 2.0, 0.0, 2.0, 8.0, 16.0, 0.0, 1.0, -3.0, -6.0, 0.0,
            ],
        );
        let information = rows.transpose() * &rows;
        let identifiable = distinguished(&information, &[vec![0], vec![1, 2, 3]], 1.0);
        // The third shows most.
        assert_eq!(identifiable, [0, 2]);
        let weights = weights(&information, &identifiable).unwrap();
        assert_eq!(weights.others, [1, 3]);
        let expected = DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.5, 0.0]);
        assert!((weights.of - expected).amax() < 1e-9);
    }
}
