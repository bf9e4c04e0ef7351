//! The free parameters of a model, and the sums of them that some motion can show.

use nalgebra::DMatrix;
use serde::Serialize;

use residyn_core::identify::{distinguished, sizes, submatrix, weights};
use residyn_core::model::{Model, Parameter};

/// Parameters that change a sum by less than this share are not listed.
const LISTED: f64 = 0.02;

/// A column whose part that is independent of the others is a smaller share of it differs from them by rounding.
const DEPENDENT: f64 = 1e-6;

/// A column that is a smaller share of the largest one is zero but for rounding.
const UNSEEN: f64 = 1e-9;

/// The free parameters, each with the magnitude that it is measured in.
#[derive(Debug, Clone)]
pub struct Parameters {
    all: Vec<Parameter>,
    /// Indices of the free ones: the columns.
    pub active: Vec<usize>,
    /// Magnitude of each column: of a body's parameter the body's own, of others the declared value or the typical one.
    pub sizes: Vec<f64>,
    /// Columns outside bodies, those of each body, those of effects.
    groups: Vec<Vec<usize>>,
}

/// A sum of free parameters that a motion can show: mostly a single one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sum {
    /// Names and weights; the first weight is 1.
    pub parts: Vec<(String, f64)>,
    /// Of the first parameter and of the sum.
    pub unit: String,
    /// At the declared values.
    pub declared: f64,
    /// Magnitude of the first parameter, by which relative intervals are measured.
    pub size: f64,
}

/// The columns that a motion can show, as sums of columns.
#[derive(Debug, Clone)]
pub struct Base {
    /// The first column of each sum.
    pub columns: Vec<usize>,
    pub sums: Vec<Sum>,
}

impl Parameters {
    /// Those of a model.
    pub fn of(model: &Model) -> Self {
        let all = model.all_parameters();
        let active: Vec<usize> = (0..all.len()).filter(|k| !all[*k].fixed).collect();
        let bodies = model.inertias();
        let magnitudes: Vec<[f64; 10]> = bodies.iter().map(|body| sizes(model, body)).collect();
        let place = |k: usize| {
            let mut bodies = bodies.iter().enumerate();
            bodies.find_map(|(b, body)| Some((b, body.iter().position(|own| *own == k)?)))
        };
        let size = |k: &usize| match place(*k).map(|(body, part)| magnitudes[body][part]) {
            Some(size) if size > 0.0 => size,
            _ => all[*k].scale,
        };
        let rank = |k: usize| match place(k) {
            Some((body, _)) => 1 + body,
            None if k < model.parameters.len() => 0,
            None => 1 + bodies.len(),
        };
        let columns = 0..active.len();
        let group = |of: usize| columns.clone().filter(|c| rank(active[*c]) == of).collect();
        Self {
            sizes: active.iter().map(size).collect(),
            groups: (0..bodies.len() + 2).map(group).collect(),
            active,
            all,
        }
    }

    /// The columns of a regressor (in units of the magnitudes) that are independent of each other, groups in their order and
    /// in each the one first that depends least on those before it: by orthogonalisation of the rows themselves, since the
    /// information, their square, has half the digits.
    pub fn independent(&self, regressor: &DMatrix<f64>) -> Base {
        let norms: Vec<f64> = regressor
            .column_iter()
            .map(|column| column.norm())
            .collect();
        let most = norms.iter().copied().fold(0.0, f64::max);
        let mut left = regressor.clone();
        let mut columns = Vec::new();
        for group in &self.groups {
            let mut open = group.clone();
            let share = |left: &DMatrix<f64>, k: usize| match norms[k] > UNSEEN * most {
                true => left.column(k).norm() / norms[k],
                false => 0.0,
            };
            while let Some(at) = (0..open.len())
                .max_by(|a, b| share(&left, open[*a]).total_cmp(&share(&left, open[*b])))
            {
                let next = open.swap_remove(at);
                if !(share(&left, next) > DEPENDENT) {
                    break;
                }
                let direction = left.column(next).normalize();
                // Twice, since the first pass leaves what it rounds.
                for _ in 0..2 {
                    let along = left.tr_mul(&direction);
                    left -= &direction * along.transpose();
                }
                columns.push(next);
            }
        }
        self.sums_of(columns, &regressor.tr_mul(regressor))
    }

    /// The columns that this information tells apart, in units of the magnitudes, without any part that is rounding error.
    pub fn base(&self, information: &DMatrix<f64>) -> Base {
        let columns = distinguished(information, &self.groups, 0.0);
        self.sums_of(columns, information)
    }

    /// The sums that these columns stand for.
    fn sums_of(&self, columns: Vec<usize>, information: &DMatrix<f64>) -> Base {
        let sums = match weights(information, &columns) {
            Some(weights) => (columns.iter().enumerate())
                .map(|(row, first)| {
                    let of_row = weights.of.row(row).into_owned();
                    let others = weights.others.iter().zip(of_row.iter());
                    let listed = others.filter(|(_, weight)| weight.abs() > LISTED);
                    let joined = listed.map(|(other, weight)| {
                        (*other, weight * self.sizes[*first] / self.sizes[*other])
                    });
                    self.sum([(*first, 1.0)].into_iter().chain(joined).collect())
                })
                .collect(),
            None => columns
                .iter()
                .map(|first| self.sum(vec![(*first, 1.0)]))
                .collect(),
        };
        Base { columns, sums }
    }

    fn sum(&self, weighed: Vec<(usize, f64)>) -> Sum {
        let parameter = |column: usize| &self.all[self.active[column]];
        let declared = weighed
            .iter()
            .map(|(column, weight)| weight * parameter(*column).value);
        let first = weighed[0].0;
        let named = |(column, weight): &(usize, f64)| (parameter(*column).name.clone(), *weight);
        Sum {
            declared: declared.sum(),
            unit: parameter(first).unit.clone(),
            size: self.sizes[first],
            parts: weighed.iter().map(named).collect(),
        }
    }

    /// Information in units of the magnitudes.
    pub fn relative(&self, information: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(information.nrows(), information.ncols(), |i, j| {
            information[(i, j)] * self.sizes[i] * self.sizes[j]
        })
    }

    /// Names of columns that are not in `base` and in no sum: nothing shows them.
    pub fn unseen(&self, base: &Base) -> Vec<String> {
        let named = |name: &str| {
            let mut parts = base.sums.iter().flat_map(|sum| &sum.parts);
            parts.any(|(own, _)| own == name)
        };
        let names = self.active.iter().map(|k| &self.all[*k].name);
        names.filter(|name| !named(name)).cloned().collect()
    }
}

impl Base {
    /// The information on the sums.
    pub fn of(&self, relative: &DMatrix<f64>) -> DMatrix<f64> {
        submatrix(relative, &self.columns, &self.columns)
    }
}
