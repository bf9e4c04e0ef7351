//! Which combinations of the bodies' parameters the logs tell: base parameters (Gautier 1991), found from the information that a
//! fit has, so that what the motion does not excite is left out as well as what no motion could.

use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::declared_body::PARTS;
use super::intervals::Uncertainty;
use super::outcome::Fit;
use super::sensitivity::{LANES, Local, Tangent};
use super::values::{Column, Values};
use crate::lanes::Row;
use crate::model::{Dynamics, Model, Parameter};

/// A parameter of a body with what moves the same torques as it does, in these logs.
#[derive(Debug, Clone, PartialEq)]
pub struct Combination {
    /// Number of the first body that it is of, 0 next to the base.
    pub body: usize,
    /// Parameters and their weights in the sum; that of the first is 1.
    pub parts: Vec<(String, f64)>,
    /// Of the first parameter and of the sum.
    pub unit: String,
    /// The sum of the declared values.
    pub declared: f64,
    /// The sum of the fitted ones.
    pub value: f64,
    pub ci95: [f64; 2],
}

/// A parameter is told apart if the logs alone give it a standard deviation below what its body has of its kind: this much
/// information, in units of that.
const TOLD: f64 = 1.0;
/// It is not if its information is smaller than this share of what it has alone: then it is rounding.
const ROUNDING: f64 = 1e-9;
/// What changes a sum by less than this share of what the body has of its first parameter's kind is not listed.
const LISTED: f64 = 0.02;

/// What logs tell of the bodies of a chain.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BodiesTold {
    /// The sums that they tell, body by body from the base to the tip.
    pub told: Vec<Combination>,
    /// How many any motion could tell.
    pub tellable: usize,
}

/// The bodies of a fit's model, and which of its columns are theirs.
struct Columns<'a> {
    fit: &'a Fit,
    dynamics: &'a Dynamics,
    /// Body and part of each column that is of a body.
    places: Vec<Option<(usize, usize)>>,
    sizes: Vec<[f64; PARTS]>,
}

impl<'a> Columns<'a> {
    fn of(fit: &'a Fit, dynamics: &'a Dynamics, declared: &Model) -> Self {
        let bodies = declared.inertias();
        let place = |column: &Column| {
            let of = |body: &[usize; PARTS]| body.iter().position(|p| *p == column.parameter);
            (0..)
                .zip(&bodies)
                .find_map(|(b, body)| Some((b, of(body)?)))
        };
        Self {
            fit,
            dynamics,
            places: fit.columns.iter().map(place).collect(),
            sizes: bodies.iter().map(|body| sizes(declared, body)).collect(),
        }
    }

    /// What the body has of the column's kind, or the scale of a value that is of none.
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

    /// A column that is told, and those of bodies that join it in a sum, with their weights in the columns' own units.
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

    /// The sum of these columns; `None` for one that no body is in, or a parameter of an effect, which nothing declares.
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

    /// Those of the declared equations that are of no body, those of each body, and those of effects: a load at the tip is told
    /// beside the bodies, and not they beside it.
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

/// What the logs of a fit by torques tell of the bodies of its model; nothing for one whose bodies are fixed, or that has none.
pub fn bodies_told(
    dynamics: &Dynamics,
    declared: &Model,
    found: &Values,
    fit: &Fit,
    uncertainty: &Uncertainty,
) -> BodiesTold {
    let columns = Columns::of(fit, dynamics, declared);
    if columns.places.iter().all(Option::is_none) {
        return BodiesTold::default();
    }
    let relative = columns.relative(&fit.equations().hessian);
    let told = told_apart(&relative, &columns.groups(declared), TOLD);
    let Some(weights) = weights(&relative, &told) else {
        return BodiesTold::default();
    };
    let sum = |(row, &first): (usize, &usize)| {
        let weighed = columns.joined(&weights, row, first);
        columns.sum(&weighed, (declared, found), uncertainty)
    };
    let mut told: Vec<Combination> = told.iter().enumerate().filter_map(sum).collect();
    told.sort_by_key(|combination| combination.body);
    BodiesTold {
        told,
        tellable: tellable(&columns),
    }
}

/// Rows of states drawn at random, some for each free value.
const ROWS: usize = 64;

/// How many sums of the bodies' parameters show in torques of states drawn at random.
fn tellable(columns: &Columns<'_>) -> usize {
    let is_of_body = |i: &usize| columns.places[*i].is_some();
    let own: Vec<usize> = (0..columns.places.len()).filter(is_of_body).collect();
    let active: Vec<usize> = own
        .iter()
        .map(|i| columns.fit.columns[*i].parameter)
        .collect();
    let tangent = Tangent::new(columns.dynamics, &active, Local::Nothing);
    let mut tape = tangent.program.tape::<f64, LANES>();
    let first = tangent.first_parameter();
    for (slot, value) in tape.inputs()[first..]
        .iter_mut()
        .zip(columns.dynamics.values())
    {
        *slot = Row::splat(value);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    // Of all columns: none for those that are of no body.
    let mut information = DMatrix::<f64>::zeros(columns.places.len(), columns.places.len());
    for _ in 0..ROWS {
        for slot in &mut tape.inputs()[..first] {
            *slot = Row(std::array::from_fn(|_| StandardNormal.sample(&mut rng)));
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
    told_apart(&columns.relative(&information), &[own], 0.0).len()
}

/// What a body has of each kind: its mass, and that with its radius of gyration and its square.
fn sizes(declared: &Model, body: &[usize; PARTS]) -> [f64; PARTS] {
    let value = |part: usize| declared.parameters[body[part]].value.abs();
    let (mass, trace) = (value(0), value(4) + value(7) + value(9));
    std::array::from_fn(|part| match part {
        0 => mass,
        1..4 => (mass * trace).sqrt(),
        _ => trace,
    })
}

/// Columns that are told apart, with at least this information; those of the first group before those of the next, in each
/// the one that is told best first.
fn told_apart(relative: &DMatrix<f64>, groups: &[Vec<usize>], least: f64) -> Vec<usize> {
    let mut left = relative.clone();
    let mut told = Vec::new();
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
            told.push(next);
        }
    }
    told
}

/// By how much each column that is told stands for the others.
struct Weights {
    others: Vec<usize>,
    /// In units of the magnitudes, one row for each that is told and one column for each other.
    of: DMatrix<f64>,
}

fn weights(relative: &DMatrix<f64>, told: &[usize]) -> Option<Weights> {
    let others: Vec<usize> = (0..relative.nrows())
        .filter(|i| !told.contains(i))
        .collect();
    let known = relative.select_rows(told).select_columns(told);
    let cross = relative.select_rows(told).select_columns(&others);
    Some(Weights {
        of: known.cholesky()?.solve(&cross),
        others,
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::{told_apart, weights};

    /// Three values of which the second and the third enter as b + 2 c alone, and one that does not show.
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
        let told = told_apart(&information, &[vec![0], vec![1, 2, 3]], 1.0);
        // The third shows most.
        assert_eq!(told, [0, 2]);
        let weights = weights(&information, &told).unwrap();
        assert_eq!(weights.others, [1, 3]);
        let expected = DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.5, 0.0]);
        assert!((weights.of - expected).amax() < 1e-9);
    }
}
