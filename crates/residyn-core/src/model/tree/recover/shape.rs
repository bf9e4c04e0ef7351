//! Fits the equations of a known kind of mechanism, which are linear in a few numbers.

use nalgebra::{DMatrix, DVector};

use crate::data::NOMINAL;
use crate::decomposition::least_squares;
use crate::model::Dynamics;
use crate::model::tree::equations::christoffel;
use crate::model::tree::series::Series;

/// The equations in a state: positions and velocities.
type At<'a> = &'a dyn Fn(&[f64], &[f64]) -> DVector<f64>;

/// Largest deviation of the equations from those of a mechanism, relative to the largest value of each entry.
pub(super) const SAME: f64 = 1e-9;
/// A number below this share of what it is added to is rounding.
pub(super) const ROUNDING: f64 = 1e-10;

pub(super) const KNOWN: &str = "it is not one of the known mechanisms: one joint, two revolute joints in one plane, a revolute joint on a prismatic one";

/// A number; 0 if it is rounding next to this size.
pub(super) fn beyond_rounding(number: f64, size: f64) -> f64 {
    if number.abs() > ROUNDING * size {
        number
    } else {
        0.0
    }
}

/// The terms whose weighted sum gives the equations of one kind of mechanism, its joints' viscous damping last.
pub(super) struct Shape {
    joints: usize,
    terms: Vec<Term>,
}

/// One term of the equations, per unit of its coefficient: its mass matrix, and the potential of its static forces.
struct Term {
    mass: Vec<Vec<Series>>,
    potential: Series,
}

impl Shape {
    pub fn turning() -> Self {
        let turning = Self::new(1).with_inertia(&one(), &[(0, 0)]);
        turning.with_weight(&[0])
    }

    pub fn sliding() -> Self {
        let sliding = Self::new(1).with_inertia(&one(), &[(0, 0)]);
        sliding.with_potential(Series::coordinate(0))
    }

    /// Coefficients: inertia of the first link with the second's mass at the elbow, coupling (two), inertia of the second
    /// link, its rotor, weight of the first link (two) and of the second (two).
    pub fn arm() -> Self {
        let [cos, sin] = waves(&[1]);
        let coupled = [(0, 0), (0, 0), (0, 1), (1, 0)];
        Self::new(2)
            .with_inertia(&one(), &[(0, 0)])
            .with_inertia(&cos, &coupled)
            .with_inertia(&sin, &coupled)
            .with_inertia(&one(), &[(0, 0), (0, 1), (1, 0), (1, 1)])
            .with_inertia(&one(), &[(1, 1)])
            .with_weight(&[0])
            .with_weight(&[0, 1])
    }

    /// Coefficients: mass of both bodies, coupling (two), inertia of the link, force along the slide, weight of the link
    /// (two).
    pub fn on_a_slide() -> Self {
        let [cos, sin] = waves(&[1]);
        let coupled = [(0, 1), (1, 0)];
        Self::new(2)
            .with_inertia(&one(), &[(0, 0)])
            .with_inertia(&cos, &coupled)
            .with_inertia(&sin, &coupled)
            .with_inertia(&one(), &[(1, 1)])
            .with_potential(Series::coordinate(0))
            .with_weight(&[1])
    }

    fn new(joints: usize) -> Self {
        Self {
            joints,
            terms: Vec::new(),
        }
    }

    /// With a function in these entries of the mass matrix, doubled where an entry is named twice.
    fn with_inertia(mut self, function: &Series, entries: &[(usize, usize)]) -> Self {
        let mut mass = self.no_mass();
        for (i, j) in entries {
            mass[*i][*j] = &mass[*i][*j] + function;
        }
        self.terms.push(Term {
            mass,
            potential: Series::default(),
        });
        self
    }

    fn with_potential(mut self, potential: Series) -> Self {
        let mass = self.no_mass();
        self.terms.push(Term { mass, potential });
        self
    }

    /// With forces that are the cosine and the sine of the sum of these joints' angles.
    fn with_weight(self, joints: &[usize]) -> Self {
        let [cos, sin] = waves(joints);
        self.with_potential(sin).with_potential(-&cos)
    }

    fn no_mass(&self) -> Vec<Vec<Series>> {
        vec![vec![Series::default(); self.joints]; self.joints]
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
        let states = states(self.joints);
        let wanted = states.iter().map(|(q, qd)| equations(declared, q, qd));
        let wanted = wanted.collect::<Option<Vec<_>>>().ok_or(KNOWN)?;
        let sizes = sizes(&wanted);
        let scaled = |of_states: &[DVector<f64>]| {
            let scaled = of_states.iter().map(|row| row.component_div(&sizes));
            DVector::from_vec(scaled.flat_map(|row| row.as_slice().to_vec()).collect())
        };
        let column =
            |at: At<'_>| scaled(&states.iter().map(|(q, qd)| at(q, qd)).collect::<Vec<_>>());
        let terms = self
            .terms
            .iter()
            .map(|term| column(&|q, qd| term.at(q, qd)));
        let damping = (0..self.joints).map(|joint| column(&|_, qd| self.damped(joint, qd)));
        let left = DMatrix::from_columns(&terms.chain(damping).collect::<Vec<_>>());
        let right = scaled(&wanted);
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

    /// The equations of viscous damping of one joint.
    fn damped(&self, joint: usize, qd: &[f64]) -> DVector<f64> {
        let n = self.joints;
        let force = DVector::from_fn(n, |i, _| if i == joint { qd[joint] } else { 0.0 });
        stacked(&DMatrix::zeros(n, n), &force)
    }
}

fn one() -> Series {
    Series::constant(1.0)
}

/// cos and sin of the sum of these joints' angles.
fn waves(joints: &[usize]) -> [Series; 2] {
    let start = [one(), Series::default()];
    joints.iter().fold(start, |[c, s], joint| {
        let (c_j, s_j) = (Series::cos(*joint), Series::sin(*joint));
        [&(&c * &c_j) - &(&s * &s_j), &(&s * &c_j) + &(&c * &s_j)]
    })
}

impl Term {
    /// The equations at a state.
    fn at(&self, q: &[f64], qd: &[f64]) -> DVector<f64> {
        let n = q.len();
        let mass = DMatrix::from_fn(n, n, |i, j| self.mass[i][j].value(q));
        let pairs = || (0..n).flat_map(|j| (j..n).map(move |k| (j, k)));
        let force = DVector::from_fn(n, |i, _| {
            let coriolis = pairs().map(|(j, k)| {
                let symbol = christoffel(&self.mass, i, j, k);
                symbol.value(q) * qd[j] * qd[k]
            });
            coriolis.sum::<f64>() + self.potential.derivative(i).value(q)
        });
        stacked(&mass, &force)
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

/// Mass matrix and bias forces at a state, stacked; none if the mass matrix is singular.
fn equations(declared: &Dynamics, q: &[f64], qd: &[f64]) -> Option<DVector<f64>> {
    let n = declared.joints;
    let values = declared.values();
    let measured = vec![NOMINAL; declared.measured.len()];
    let accelerations = |tau: &DVector<f64>| {
        let inputs = [q, qd, tau.as_slice(), &measured, &[0.0], &values].concat();
        DVector::from_column_slice(&declared.program.eval(&inputs)[n..])
    };
    let free = accelerations(&DVector::zeros(n));
    let unit = |j: usize| DVector::from_fn(n, |i, _| if i == j { 1.0 } else { 0.0 });
    let columns: Vec<_> = (0..n).map(|j| accelerations(&unit(j)) - &free).collect();
    let mass = DMatrix::from_columns(&columns).try_inverse()?;
    let force = -(&mass * free);
    let all = stacked(&mass, &force);
    all.iter().all(|x| x.is_finite()).then_some(all)
}

fn stacked(mass: &DMatrix<f64>, force: &DVector<f64>) -> DVector<f64> {
    DVector::from_iterator(mass.len() + force.len(), mass.iter().chain(force).copied())
}

/// The largest magnitude of each entry. Entries that are rounding alone get the overall largest.
fn sizes(rows: &[DVector<f64>]) -> DVector<f64> {
    let none = DVector::zeros(rows[0].len());
    let largest = rows.iter().fold(none, |most, row| most.sup(&row.abs()));
    let overall = largest.max();
    largest.map(|size| match size > ROUNDING * overall {
        true => size,
        false => overall,
    })
}
