//! The parameters that the motion shows on their own (base parameters), and what each is made of.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::equations::{Column, Kind};
use super::series::{Wave, rounded};

/// How far a column must stand out of the others, relative to its length.
const INDEPENDENT: f64 = 1e-10;

/// A parameter that the motion shows, with those that it shows only together with this one.
#[derive(Debug, Clone)]
pub(super) struct Base {
    /// Its own, and what a unit of the whole adds to the equations.
    pub column: Column,
    /// Of the whole.
    pub value: f64,
    /// The others: a factor, and which parameter of which joint.
    pub others: Vec<(f64, Kind, usize)>,
}

impl Base {
    /// Whether the whole is a sum of what no body has below zero.
    pub fn is_positive(&self) -> bool {
        let positive = |kind: &Kind| match kind {
            Kind::Tensor(a, b) => a == b,
            Kind::Moment(_) => false,
            Kind::Mass | Kind::Rotor => true,
        };
        let mut others = self.others.iter();
        positive(&self.column.kind)
            && others.all(|(factor, kind, _)| *factor > 0.0 && positive(kind))
    }
}

/// Keep the first of each set of columns that depend on each other, and put the values of the rest into those kept.
pub(super) fn base_parameters(columns: Vec<Column>) -> Vec<Base> {
    let vectors = vectors(&columns);
    let (mut base, mut kept, mut directions) = (Vec::<Base>::new(), Vec::new(), Vec::new());
    for (column, vector) in columns.into_iter().zip(vectors) {
        // Twice is enough against rounding.
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

/// The columns as vectors of numbers over all entries of the mass matrix, all of the potential, and all waves.
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

/// What is left of a vector beyond orthogonal directions of length 1.
fn without(directions: &[DVector<f64>], vector: &DVector<f64>) -> DVector<f64> {
    let rest = vector.clone();
    directions.iter().fold(rest, |rest, direction| {
        let along = direction.dot(&rest);
        rest - direction * along
    })
}

/// The factors with which independent vectors add up to a dependent one.
fn factors(kept: &[DVector<f64>], vector: &DVector<f64>) -> Vec<f64> {
    // In vectors of length 1, whatever the units.
    let unit: Vec<DVector<f64>> = kept.iter().map(DVector::normalize).collect();
    let svd = DMatrix::from_columns(&unit).svd(true, true);
    let solution = svd.solve(vector, 0.0).expect("both factors were asked for");
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
