//! Fits the equations of a known kind of mechanism, which are linear in a few numbers.

use nalgebra::{DMatrix, DVector};

use crate::decomposition::least_squares;
use crate::model::Dynamics;
use crate::model::chain::series::Series;

/// Largest deviation of the equations from those of a mechanism, relative to the largest value of each entry.
pub(super) const SAME: f64 = 1e-9;
/// A number below this share of what it is added to is rounding.
pub(super) const ROUNDING: f64 = 1e-10;
pub(super) const KNOWN: &str = "it is not one of the known mechanisms: one joint, two revolute joints in one plane, a revolute joint on a prismatic one";

/// The terms whose weighted sum gives the equations of one kind of mechanism.
pub(super) struct Shape {
    joints: usize,
    parts: Vec<Part>,
}

/// One term of the equations, per unit of its coefficient.
enum Part {
    /// In entries of the mass matrix: row, column, function.
    Mass(Vec<(usize, usize, Series)>),
    /// In the static forces of joints: joint, function.
    Force(Vec<(usize, Series)>),
    /// In the viscous damping of a joint.
    Damping(usize),
}

impl Shape {
    pub fn turning() -> Self {
        let one = || Series::constant(1.0);
        let mut parts = vec![Part::Mass(vec![(0, 0, one())])];
        parts.extend(waves(&[0]).map(|wave| Part::Force(vec![(0, wave)])));
        Self::new(1, parts)
    }

    pub fn sliding() -> Self {
        let one = || Series::constant(1.0);
        let parts = vec![
            Part::Mass(vec![(0, 0, one())]),
            Part::Force(vec![(0, one())]),
        ];
        Self::new(1, parts)
    }

    /// Coefficients: inertia of the first link with the second's mass at the elbow, coupling (two), inertia of the second
    /// link, its rotor, weight of the first link (two) and of the second (two).
    pub fn arm() -> Self {
        let one = || Series::constant(1.0);
        let mut parts = vec![Part::Mass(vec![(0, 0, one())])];
        let coupling = |wave: Series| vec![(0, 0, &wave * 2.0), (0, 1, wave)];
        parts.extend(waves(&[1]).map(|wave| Part::Mass(coupling(wave))));
        parts.push(Part::Mass(vec![
            (0, 0, one()),
            (0, 1, one()),
            (1, 1, one()),
        ]));
        parts.push(Part::Mass(vec![(1, 1, one())]));
        parts.extend(waves(&[0]).map(|wave| Part::Force(vec![(0, wave)])));
        let both = |wave: Series| vec![(0, wave.clone()), (1, wave)];
        parts.extend(waves(&[0, 1]).map(|wave| Part::Force(both(wave))));
        Self::new(2, parts)
    }

    pub fn on_a_slide() -> Self {
        let one = || Series::constant(1.0);
        let mut parts = vec![Part::Mass(vec![(0, 0, one())])];
        parts.extend(waves(&[1]).map(|wave| Part::Mass(vec![(0, 1, wave)])));
        parts.push(Part::Mass(vec![(1, 1, one())]));
        parts.push(Part::Force(vec![(0, one())]));
        parts.extend(waves(&[1]).map(|wave| Part::Force(vec![(1, wave)])));
        Self::new(2, parts)
    }

    fn new(joints: usize, mut parts: Vec<Part>) -> Self {
        parts.extend((0..joints).map(Part::Damping));
        Self { joints, parts }
    }

    /// The damping of each joint, among the coefficients.
    pub fn damping<'f>(&self, found: &'f [f64]) -> &'f [f64] {
        &found[found.len() - self.joints..]
    }

    /// The coefficient of each term, by least squares over states that fill the state space.
    ///
    /// # Errors
    /// Equations that no coefficients reproduce.
    pub fn fit(&self, declared: &Dynamics) -> Result<Vec<f64>, String> {
        let n = self.joints;
        let (mut rows, mut wanted) = (Vec::new(), Vec::new());
        for (q, qd) in states(n) {
            let (mass, force) = inverse_dynamics(declared, &q, &qd).ok_or(KNOWN)?;
            let columns: Vec<_> = self.parts.iter().map(|part| part.at(n, &q, &qd)).collect();
            rows.push(DMatrix::from_columns(&columns));
            wanted.push(stacked(&mass, &force));
        }
        let sizes = sizes(&wanted);
        let scaled = |mut matrix: DMatrix<f64>| {
            for (mut row, size) in matrix.row_iter_mut().zip(&sizes) {
                row /= *size;
            }
            matrix
        };
        let entries = sizes.len();
        let mut left = DMatrix::zeros(entries * rows.len(), self.parts.len());
        let mut right = DVector::zeros(entries * rows.len());
        for (k, (row, wanted)) in rows.into_iter().zip(&wanted).enumerate() {
            left.rows_mut(k * entries, entries).copy_from(&scaled(row));
            let column = DMatrix::from_column_slice(entries, 1, wanted.as_slice());
            right
                .rows_mut(k * entries, entries)
                .copy_from(&scaled(column));
        }
        let found = least_squares(left.clone(), &right, 1e-12)
            .ok_or("its masses or forces are too small or too large to be distinguished")?;
        let off = (&left * &found - &right).amax();
        if !(off <= SAME) {
            return Err(format!(
                "{KNOWN} (off by {off:.1e} of the largest torque or inertia)"
            ));
        }
        Ok(found.iter().copied().collect())
    }
}

/// cos and sin of the sum of these joints' angles.
fn waves(joints: &[usize]) -> impl Iterator<Item = Series> {
    let start = (Series::constant(1.0), Series::default());
    let (cos, sin) = joints.iter().fold(start, |(c, s), joint| {
        let (c_j, s_j) = (Series::cos(*joint), Series::sin(*joint));
        (&(&c * &c_j) - &(&s * &s_j), &(&s * &c_j) + &(&c * &s_j))
    });
    [cos, sin].into_iter()
}

impl Part {
    /// The term's entries of the mass matrix and the forces at a state, stacked.
    fn at(&self, n: usize, q: &[f64], qd: &[f64]) -> DVector<f64> {
        let (mut mass, mut force) = (DMatrix::zeros(n, n), DVector::zeros(n));
        match self {
            Self::Mass(entries) => {
                for (i, j, series) in entries {
                    mass[(*i, *j)] += series.value(q);
                    if i != j {
                        mass[(*j, *i)] += series.value(q);
                    }
                    add_coriolis(&mut force, (*i, *j), series, q, qd);
                }
            }
            Self::Force(entries) => {
                entries
                    .iter()
                    .for_each(|(i, series)| force[*i] += series.value(q));
            }
            Self::Damping(joint) => force[*joint] += qd[*joint],
        }
        stacked(&mass, &force)
    }
}

/// Add the Coriolis and centrifugal forces of one entry of M and of its mirror image: dM/dt qd - grad(qd M qd) / 2.
fn add_coriolis(
    force: &mut DVector<f64>,
    (i, j): (usize, usize),
    series: &Series,
    q: &[f64],
    qd: &[f64],
) {
    let slopes: Vec<f64> = (0..q.len())
        .map(|k| series.derivative(k).value(q))
        .collect();
    let rate: f64 = slopes.iter().zip(qd).map(|(slope, qd)| slope * qd).sum();
    let twice = if i == j { 1.0 } else { 2.0 };
    force[i] += rate * qd[j];
    if i != j {
        force[j] += rate * qd[i];
    }
    for (force, slope) in force.iter_mut().zip(slopes) {
        *force -= 0.5 * twice * slope * qd[i] * qd[j];
    }
}

/// Positions and velocities without symmetry, 0 among them.
fn states(n: usize) -> Vec<(Vec<f64>, Vec<f64>)> {
    let mut states = vec![(vec![0.0; n], vec![0.0; n])];
    // The fractional parts of multiples of an irrational number are spread evenly.
    let spread =
        |k: usize, root: f64, range: f64| range * (2.0 * (k as f64 * root.sqrt()).fract() - 1.0);
    for k in 1..60 {
        let of = |roots: [f64; 2], range| {
            roots[..n]
                .iter()
                .map(|root| spread(k, *root, range))
                .collect()
        };
        states.push((of([2.0, 3.0], 3.0), of([5.0, 7.0], 4.0)));
    }
    states
}

/// Mass matrix and bias forces at a state; none if the mass matrix is singular.
fn inverse_dynamics(
    declared: &Dynamics,
    q: &[f64],
    qd: &[f64],
) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let n = declared.joints;
    let values = declared.values();
    let accelerations = |tau: &DVector<f64>| {
        let inputs = [q, qd, tau.as_slice(), &[0.0], &values].concat();
        DVector::from_column_slice(&declared.program.eval(&inputs)[n..])
    };
    let free = accelerations(&DVector::zeros(n));
    let unit = |j: usize| DVector::from_fn(n, |i, _| if i == j { 1.0 } else { 0.0 });
    let columns: Vec<_> = (0..n).map(|j| accelerations(&unit(j)) - &free).collect();
    let mass = DMatrix::from_columns(&columns).try_inverse()?;
    let force = -(&mass * free);
    (mass.iter().chain(&force).all(|x| x.is_finite())).then_some((mass, force))
}

fn stacked(mass: &DMatrix<f64>, force: &DVector<f64>) -> DVector<f64> {
    DVector::from_iterator(mass.len() + force.len(), mass.iter().chain(force).copied())
}

/// The largest magnitude of each entry. Entries that are rounding alone get the overall largest.
fn sizes(rows: &[DVector<f64>]) -> Vec<f64> {
    let entries = rows[0].len();
    let largest = (0..entries).map(|k| rows.iter().map(|row| row[k].abs()).fold(0.0, f64::max));
    let largest: Vec<f64> = largest.collect();
    let overall = largest.iter().copied().fold(0.0, f64::max);
    largest
        .into_iter()
        .map(|size| {
            if size > ROUNDING * overall {
                size
            } else {
                overall
            }
        })
        .collect()
}
