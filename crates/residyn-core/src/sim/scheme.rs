//! The table of integration schemes that every stepper, and every exported step, reads.

/// An explicit one-step method for ds/dt = f(s, t) whose stages each need only the stage before:
/// k_i = f(s + reach_(i-1) h k_(i-1), t + time_i h), then s' = s + h sum_i weight_i k_i. As a Butcher tableau, zero
/// off the first subdiagonal.
#[derive(Debug)]
pub struct Scheme {
    /// As it is written in files and on the command line.
    pub name: &'static str,
    /// Its name in a sentence, after "the".
    pub title: &'static str,
    /// The error over a given time is proportional to the step's length to this power.
    pub order: u32,
    /// At least one.
    pub stages: &'static [Stage],
    /// For schemes of one stage: positions move with the new velocities, v' = v + h f_v and q' = q + h (f_q + h f_v).
    /// If f_q = v, this is q' = q + h v'; any other part of f_q is taken at the step's start.
    pub semi_implicit: bool,
    /// Largest decay rate times step length at which the steps decay as well.
    pub most_damping: f64,
    /// Largest angular frequency times step length at which the steps of a swing without damping do not grow.
    pub most_swing: f64,
}

/// One evaluation of the derivative within a step of length h.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stage {
    /// When it is evaluated, as a share of the step.
    pub time: f64,
    /// How far along its slope the next stage lies, as a share of the step; 0 after the last.
    pub reach: f64,
    /// Weight of its slope in the step's slope; the weights sum to 1.
    pub weight: f64,
}

/// Order 1, and symplectic if forces depend on positions alone.
pub const SEMI_IMPLICIT_EULER: &Scheme = &Scheme {
    name: "semi_implicit_euler",
    title: "semi-implicit Euler method",
    order: 1,
    stages: &stages([0.0], [1.0]),
    semi_implicit: true,
    most_damping: 2.0,
    most_swing: 2.0,
};

/// Heun 1900.
pub const HEUN: &Scheme = &Scheme {
    name: "heun",
    title: "method of Heun",
    order: 2,
    stages: &stages([0.0, 1.0], [0.5, 0.5]),
    semi_implicit: false,
    most_damping: 2.0,
    most_swing: 0.0,
};

/// Kutta 1901.
pub const RK4: &Scheme = &Scheme {
    name: "rk4",
    title: "classical Runge-Kutta method",
    order: 4,
    stages: &stages(
        [0.0, 0.5, 0.5, 1.0],
        [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
    ),
    semi_implicit: false,
    most_damping: 2.785,
    most_swing: 2.828,
};

/// Order 3 in as many stages as the method of order 4, for friction that brings joints to rest fast: its stability polynomial
/// 1 + z + z^2/2 + z^3/6 + 0.0252 z^4 stays between 0 and 1 as far as z = -4.13, so that nothing chatters (for such polynomials see van
/// der Houwen 1977, chapter 2). Of the coefficients that have it those with the least errors of order 4 on a grid of the last two times.
pub const STABILISED_RK3: &Scheme = &Scheme {
    name: "stabilised_rk3",
    title: "stabilised Runge-Kutta method of order 3",
    order: 3,
    stages: &stages(
        [0.0, 0.268_248_206_460_481_8, 0.74, 0.83],
        [
            0.100_653_199_921_281_76,
            0.380_035_168_124_050_86,
            0.366_360_075_150_647_17,
            0.152_951_556_804_020_23,
        ],
    ),
    semi_implicit: false,
    most_damping: 4.13,
    most_swing: 2.33,
};

/// Every scheme. A new one is one more entry here.
pub const SCHEMES: [&Scheme; 4] = [SEMI_IMPLICIT_EULER, HEUN, RK4, STABILISED_RK3];

impl Scheme {
    /// The scheme of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        SCHEMES.into_iter().find(|scheme| scheme.name == name)
    }
}

/// Schemes are distinguished by their names.
impl PartialEq for Scheme {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Scheme {}

/// Stages from their times and weights: consistent schemes of this form reach the time of the next stage.
const fn stages<const N: usize>(times: [f64; N], weights: [f64; N]) -> [Stage; N] {
    let none = Stage {
        time: 0.0,
        reach: 0.0,
        weight: 0.0,
    };
    let mut stages = [none; N];
    let mut k = 0;
    while k < N {
        stages[k] = Stage {
            time: times[k],
            reach: if k + 1 < N { times[k + 1] } else { 0.0 },
            weight: weights[k],
        };
        k += 1;
    }
    stages
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::{SCHEMES, Scheme};

    /// By how much one step of length 1 changes the solution of dx/dt = rate x.
    fn growth(scheme: &Scheme, rate: Complex<f64>) -> f64 {
        let one = Complex::new(1.0, 0.0);
        let (mut inner, mut sum) = (one, one);
        for stage in scheme.stages {
            let slope = rate * inner;
            sum += slope * stage.weight;
            inner = one + slope * stage.reach;
        }
        sum.norm()
    }

    #[test]
    fn the_table_is_consistent() {
        for scheme in SCHEMES {
            let weights: f64 = scheme.stages.iter().map(|stage| stage.weight).sum();
            assert!((weights - 1.0).abs() < 1e-15, "{}", scheme.name);
            assert_eq!(scheme.stages[0].time, 0.0, "{}", scheme.name);
            assert!(!scheme.semi_implicit || scheme.stages.len() == 1);
            assert_eq!(Scheme::named(scheme.name), Some(scheme));
        }
    }

    /// All rates as far as a limit decay, and those just beyond it do not.
    #[test]
    fn steps_decay_as_far_as_their_limits() {
        for scheme in SCHEMES.into_iter().filter(|scheme| !scheme.semi_implicit) {
            for (limit, direction) in [
                (scheme.most_damping, Complex::new(-1.0, 0.0)),
                (scheme.most_swing, Complex::new(0.0, 1.0)),
            ] {
                let at = |share: f64| growth(scheme, direction * share * limit.max(0.01));
                let inside =
                    limit > 0.0 && (1..=100).all(|k| at(f64::from(k) / 100.0) <= 1.0 + 1e-9);
                assert!(inside || limit == 0.0, "{}: {limit}", scheme.name);
                assert!(at(1.01) > 1.0, "{}: {limit}", scheme.name);
            }
        }
    }
}
