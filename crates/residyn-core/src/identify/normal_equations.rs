//! Normal equations of windows. A window's own values (its start state, and forces if they are free) do not enter other
//! windows, so they are eliminated by the Schur complement before windows are summed.

use std::borrow::Cow;
use std::ops::AddAssign;

use nalgebra::{DMatrix, DVector};

use super::values::Layout;
use crate::sim::Window;

/// The normal equations of a window: shared parameters first, then the window's own free values.
#[derive(Debug, Clone)]
pub struct WindowTerms {
    /// Sum of the Huber losses of the residuals.
    pub cost: f64,
    pub gradient: DVector<f64>,
    pub hessian: DMatrix<f64>,
}

impl WindowTerms {
    /// Zero normal equations of this many free values.
    pub fn zeros(values: usize) -> Self {
        Self {
            cost: 0.0,
            gradient: DVector::zeros(values),
            hessian: DMatrix::zeros(values, values),
        }
    }

    /// Take a free value for one that the residuals do not depend on.
    pub fn forget(&mut self, value: usize) {
        self.gradient[value] = 0.0;
        self.hessian.row_mut(value).fill(0.0);
        self.hessian.column_mut(value).fill(0.0);
    }
}

impl AddAssign<&Self> for WindowTerms {
    fn add_assign(&mut self, other: &Self) {
        self.cost += other.cost;
        self.gradient += &other.gradient;
        self.hessian += &other.hessian;
    }
}

/// The normal equations of one window in some of a fit's free values, its own values eliminated.
#[derive(Debug, Clone)]
pub struct Reduced {
    /// Which of the fit's free values, in the order of `terms`.
    pub columns: Vec<usize>,
    pub terms: WindowTerms,
}

impl Reduced {
    pub(super) fn of(terms: &WindowTerms, columns: &[usize]) -> Self {
        let part = Eliminated::new(terms, columns.len(), 0.0);
        Self {
            columns: columns.to_vec(),
            terms: WindowTerms {
                cost: terms.cost,
                gradient: part.gradient.into_owned(),
                hessian: part.matrix.into_owned(),
            },
        }
    }

    /// Add this window to the normal equations in all free values.
    pub fn add_to(&self, all: &mut WindowTerms) {
        all.cost += self.terms.cost;
        self.add_gradient_to(&mut all.gradient);
        scatter_matrix(&self.terms.hessian, &mut all.hessian, &self.columns);
    }

    /// The same for the gradient alone.
    pub fn add_gradient_to(&self, all: &mut DVector<f64>) {
        scatter(&self.terms.gradient, all, &self.columns);
    }
}

/// The normal equations of all windows in the free values of a fit.
pub(super) struct Normal {
    pub windows: Vec<OwnValues>,
    pub matrix: DMatrix<f64>,
    pub gradient: DVector<f64>,
}

impl Normal {
    /// `shared` free values enter each window; the window's own values are damped by `damping`, a share of the
    /// diagonal.
    pub fn new(
        terms: &[WindowTerms],
        windows: &[Window],
        layout: &Layout,
        shared: usize,
        damping: f64,
    ) -> Self {
        let size = layout.columns.len();
        let mut normal = Self {
            windows: Vec::with_capacity(terms.len()),
            matrix: DMatrix::zeros(size, size),
            gradient: DVector::zeros(size),
        };
        for (terms, window) in terms.iter().zip(windows) {
            let part = Eliminated::new(terms, shared, damping);
            scatter_matrix(&part.matrix, &mut normal.matrix, layout.places(window));
            scatter(&part.gradient, &mut normal.gradient, layout.places(window));
            normal.windows.push(part.own);
        }
        normal
    }

    /// By how much a step of the free values lowers the quadratic model of the cost, the windows' own values following.
    pub fn predicted_decrease(&self, step: &DVector<f64>) -> f64 {
        let own: f64 = self.windows.iter().map(|own| own.decrease).sum();
        -self.gradient.dot(step) - 0.5 * step.dot(&(&self.matrix * step)) + own
    }
}

/// One window's normal equations with its own values eliminated.
struct Eliminated<'t> {
    matrix: Cow<'t, DMatrix<f64>>,
    gradient: Cow<'t, DVector<f64>>,
    own: OwnValues,
}

/// How a window's own values follow the shared ones.
pub(super) struct OwnValues {
    /// Step of the own values = -(own^-1 gradient) - (own^-1 cross) step of the shared ones.
    gradient: DVector<f64>,
    cross: DMatrix<f64>,
    /// Predicted decrease of the cost if only the own values take a step.
    decrease: f64,
}

impl<'t> Eliminated<'t> {
    fn new(terms: &'t WindowTerms, shared: usize, damping: f64) -> Self {
        let start_states = terms.gradient.len() - shared;
        if start_states == 0 {
            return Self {
                matrix: Cow::Borrowed(&terms.hessian),
                gradient: Cow::Borrowed(&terms.gradient),
                own: OwnValues {
                    gradient: DVector::zeros(0),
                    cross: DMatrix::zeros(0, shared),
                    decrease: 0.0,
                },
            };
        }
        let part = |first: (usize, usize), size: (usize, usize)| {
            terms.hessian.view(first, size).into_owned()
        };
        let mut own = part((shared, shared), (start_states, start_states));
        for i in 0..start_states {
            own[(i, i)] += damping * own[(i, i)] + 1e-12;
        }
        let cross = part((shared, 0), (start_states, shared));
        let own_gradient = terms.gradient.rows(shared, start_states).into_owned();
        let inverse = own.clone().cholesky().map_or_else(
            // Not positive definite: the window does not determine its own values, which then stay.
            || DMatrix::zeros(start_states, start_states),
            |cholesky| cholesky.inverse(),
        );
        let local_gradient = &inverse * &own_gradient;
        let local_cross = &inverse * &cross;
        let matrix =
            terms.hessian.view((0, 0), (shared, shared)) - cross.transpose() * &local_cross;
        let gradient = terms.gradient.rows(0, shared) - cross.transpose() * &local_gradient;
        Self {
            matrix: Cow::Owned(matrix),
            gradient: Cow::Owned(gradient),
            own: OwnValues {
                decrease: 0.5 * own_gradient.dot(&local_gradient),
                gradient: local_gradient,
                cross: local_cross,
            },
        }
    }
}

impl OwnValues {
    /// The step of the window's own values that belongs to a step of the shared ones.
    pub fn step(&self, shared_step: &DVector<f64>) -> DVector<f64> {
        -(&self.gradient + &self.cross * shared_step)
    }
}

/// The solution for the `free` unknowns with the others at zero; `None` if the matrix of the free ones is not positive
/// definite or not finite.
pub(super) fn solve_part(
    matrix: &DMatrix<f64>,
    right: &DVector<f64>,
    free: &[usize],
) -> Option<DVector<f64>> {
    if free.is_empty() {
        return Some(DVector::zeros(0));
    }
    let part = submatrix(matrix, free, free);
    let solution = part.cholesky()?.solve(&right.select_rows(free));
    (solution.iter().all(|value| value.is_finite())).then_some(solution)
}

/// The part of a matrix in these rows and columns.
pub fn submatrix(matrix: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    let mut part = Vec::with_capacity(rows.len() * columns.len());
    for &column in columns {
        let values = &matrix.as_slice()[matrix.nrows() * column..][..matrix.nrows()];
        part.extend(rows.iter().map(|&row| values[row]));
    }
    DMatrix::from_vec(rows.len(), columns.len(), part)
}

/// A matrix in units in which its diagonal is one, and the size of each unit; a diagonal that is not positive stays.
pub fn with_unit_diagonal(matrix: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let unit = matrix
        .diagonal()
        .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 });
    let scaled = |i: usize, j: usize| matrix[(i, j)] * unit[i] * unit[j];
    (DMatrix::from_fn(unit.len(), unit.len(), scaled), unit)
}

fn scatter(part: &DVector<f64>, all: &mut DVector<f64>, places: &[usize]) {
    for (value, &place) in part.iter().zip(places) {
        all[place] += value;
    }
}

fn scatter_matrix(part: &DMatrix<f64>, all: &mut DMatrix<f64>, places: &[usize]) {
    if is_each_in_its_place(places, all.nrows()) {
        *all += part;
        return;
    }
    for (j, &column) in places.iter().enumerate() {
        let mut all = all.column_mut(column);
        for (value, &row) in part.column(j).iter().zip(places) {
            all[row] += value;
        }
    }
}

/// Whether values go where they are, and to every place, as in windows of a model without values per log.
fn is_each_in_its_place(places: &[usize], size: usize) -> bool {
    places.len() == size && places.iter().enumerate().all(|(k, place)| k == *place)
}
