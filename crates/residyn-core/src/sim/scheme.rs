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
};

/// Heun 1900.
pub const HEUN: &Scheme = &Scheme {
    name: "heun",
    title: "method of Heun",
    order: 2,
    stages: &stages([0.0, 1.0], [0.5, 0.5]),
    semi_implicit: false,
    most_damping: 2.0,
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
};

/// Every scheme. A new one is one more entry here.
pub const SCHEMES: [&Scheme; 3] = [SEMI_IMPLICIT_EULER, HEUN, RK4];

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
    use super::{SCHEMES, Scheme};

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
}
