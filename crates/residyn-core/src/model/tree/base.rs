//! Base parameters: the combinations of physical parameters that the motion determines, and what each consists of.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::equations::{Column, Kind};
use super::series::{Wave, rounded};
use crate::data::Joint;
use crate::decomposition::least_squares;

/// Smallest part of a column that counts as independent of the others, relative to its length.
const INDEPENDENT: f64 = 1e-10;

/// A base parameter: a physical parameter together with those that the motion determines only in combination with it.
#[derive(Debug, Clone)]
pub(super) struct Base {
    /// The physical parameter, and the contribution of a unit of the combination to the equations.
    pub column: Column,
    /// Value of the combination.
    pub value: f64,
    /// The other parameters: factor, kind and joint.
    pub others: Vec<(f64, Kind, Joint)>,
}

impl Base {
    /// Whether the combination is a sum of quantities that are never negative.
    pub fn is_positive(&self) -> bool {
        let mut others = self.others.iter();
        self.column.kind.is_never_negative()
            && others.all(|(factor, kind, _)| *factor > 0.0 && kind.is_never_negative())
    }
}

/// Keep the first of each set of linearly dependent columns, and add the values of the others to those kept.
pub(super) fn base_parameters(columns: Vec<Column>) -> Vec<Base> {
    let vectors = vectors(&columns);
    let (mut base, mut kept, mut directions) = (Vec::<Base>::new(), Vec::new(), Vec::new());
    for (column, vector) in columns.into_iter().zip(vectors) {
        // Orthogonalising twice is enough against rounding.
        let beyond = without(&directions, &without(&directions, &vector));
        let stands_out = beyond.norm();
        if stands_out > INDEPENDENT * vector.norm() {
            directions.push(beyond / stands_out);
            kept.push(vector);
            base.push(Base {
                value: column.value,
                others: Vec::new(),
                column,
            });
        } else if vector.norm() > 0.0 {
            for (whole, factor) in base.iter_mut().zip(factors(&kept, &vector)) {
                whole.take_in(factor, &column);
            }
        }
    }
    base
}

impl Base {
    fn take_in(&mut self, factor: f64, other: &Column) {
        if factor != 0.0 {
            self.value += factor * other.value;
            self.others.push((factor, other.kind, other.joint));
        }
    }
}

/// The columns as vectors over all entries of the mass matrix and the potential, and all basis functions.
fn vectors(columns: &[Column]) -> Vec<DVector<f64>> {
    let mut places = BTreeMap::<(usize, Wave), usize>::new();
    let entries: Vec<Vec<(usize, f64)>> = columns
        .iter()
        .map(|column| {
            let functions = column.mass.iter().flatten().chain([&column.potential]);
            let terms = functions.enumerate().flat_map(|(f, series)| {
                series
                    .terms()
                    .map(move |(wave, factor)| ((f, *wave), factor))
            });
            terms
                .map(|(key, factor)| {
                    let next = places.len();
                    (*places.entry(key).or_insert(next), factor)
                })
                .collect()
        })
        .collect();
    let vector = |entries: &Vec<(usize, f64)>| {
        let mut vector = DVector::zeros(places.len());
        entries
            .iter()
            .for_each(|(place, factor)| vector[*place] = *factor);
        vector
    };
    entries.iter().map(vector).collect()
}

/// The part of a vector orthogonal to orthonormal directions.
fn without(directions: &[DVector<f64>], vector: &DVector<f64>) -> DVector<f64> {
    let rest = vector.clone();
    directions.iter().fold(rest, |rest, direction| {
        let along = direction.dot(&rest);
        rest - direction * along
    })
}

/// The coefficients of a dependent vector in terms of independent ones.
fn factors(kept: &[DVector<f64>], vector: &DVector<f64>) -> Vec<f64> {
    // Normalised, so that units do not matter.
    let unit: Vec<DVector<f64>> = kept.iter().map(DVector::normalize).collect();
    let solution = least_squares(DMatrix::from_columns(&unit), vector, 0.0);
    let solution = solution.expect("vectors of length one are finite");
    let in_units = solution.iter().zip(kept);
    in_units
        .map(|(share, kept)| {
            let is_rounding = share.abs() <= 1e-12 * vector.norm();
            if is_rounding {
                0.0
            } else {
                rounded(share / kept.norm())
            }
        })
        .collect()
}
