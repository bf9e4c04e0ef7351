//! The friction and the torques that effects add to a joint, one line each, written by hand.

/// Where a law is evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct At {
    /// Angle \[rad\], speed \[rad/s\] and time \[s\].
    pub q: f64,
    pub v: f64,
    pub t: f64,
    /// Torque through the gear \[N m\].
    pub load: f64,
    /// Of the motion, 1 or -1: a joint at rest may be about to move either way.
    pub direction: f64,
}

/// A torque \[N m\], of the effect's numbers and the place.
type Formula = fn(&[f64], At) -> f64;

/// Effect, names of its numbers, torque.
type Entry = (&'static str, &'static [&'static str], Formula);

/// Torques that vary smoothly with the motion of their joint. The ripple of an effect file has a whole number of periods
/// per turn.
pub const SMOOTH: &[Entry] = &[
    ("viscous_friction", &["b"], |n, at| -n[0] * at.v),
    ("asymmetric_friction", &["b_p", "b_n"], |n, at| {
        -at.v * if at.v > 0.0 { n[0] } else { n[1] }
    }),
    // Grows as the logarithm of the speed far above the bend.
    ("degressive_friction", &["F_d", "v_d"], |n, at| {
        -n[0] * (at.v / n[1]).asinh()
    }),
    ("quadratic_drag", &["c"], |n, at| -n[0] * at.v * at.v.abs()),
    ("cubic_damping", &["c"], |n, at| -n[0] * at.v * at.v * at.v),
    ("joint_spring", &["k", "q_0"], |n, at| -n[0] * (at.q - n[1])),
    ("stiffening_spring", &["k", "q_0", "k_c"], |n, at| {
        let bend = at.q - n[1];
        -bend * (n[0] + n[2] * bend * bend)
    }),
    ("constant_torque", &["tau_0"], |n, _| n[0]),
    ("cogging_torque", &["A", "N", "phase"], ripple),
    ("fractional_ripple", &["A", "N", "phase"], ripple),
    ("gear_ripple", &["A", "c", "N", "phase"], |n, at| {
        (n[0] + n[1] * at.load.abs()) * (n[2] * at.q + n[3]).sin()
    }),
    ("periodic_disturbance", &["A", "f", "phase"], |n, at| {
        n[0] * (std::f64::consts::TAU * n[1] * at.t + n[2]).sin()
    }),
];

/// Levels of dry friction, which acts against the motion; at rest it is whatever torque holds the joint, up to this level.
pub const DRY: &[Entry] = &[
    ("coulomb_friction", &["F_c"], |n, _| n[0]),
    ("stribeck_friction", &["F_c", "F_s", "v_s"], |n, at| {
        n[0] + (n[1] - n[0]) * (-(at.v / n[2]).powi(2)).exp()
    }),
    ("asymmetric_friction", &["F_p", "F_n"], |n, at| {
        if at.direction > 0.0 { n[0] } else { n[1] }
    }),
    ("load_friction", &["k"], |n, at| n[0] * at.load.abs()),
    ("gear_friction", &["k_driving", "k_driven"], |n, at| {
        let is_driving = at.load * at.direction > 0.0;
        if is_driving {
            n[0] * at.load.abs()
        } else {
            n[1] * at.load.abs()
        }
    }),
    ("angle_friction", &["F_0", "c"], |n, at| {
        (n[0] + n[1] * at.q).max(0.0)
    }),
    ("uneven_friction", &["F", "a"], |n, at| {
        n[0] * (1.0 + n[1] * at.q.sin())
    }),
];

fn ripple(n: &[f64], at: At) -> f64 {
    n[0] * (n[1] * at.q + n[2]).sin()
}

/// A law with its numbers.
#[derive(Debug, Clone)]
pub struct Law {
    numbers: Vec<f64>,
    formula: Formula,
    /// Whether the speed changes it.
    pub is_friction: bool,
}

impl Law {
    /// The law of an effect in a table, if it has one there; `number` finds its numbers by name.
    ///
    /// # Errors
    /// As `number`.
    pub fn of(
        table: &[Entry],
        effect: &str,
        number: &mut impl FnMut(&str) -> Result<f64, String>,
    ) -> Result<Option<Self>, String> {
        let entry = table.iter().find(|(name, ..)| *name == effect);
        let law = entry.map(|(_, names, formula)| {
            let numbers = names.iter().map(|name| number(name));
            let numbers = numbers.collect::<Result<Vec<f64>, String>>()?;
            let at = |v: f64| formula(&numbers, At { v, ..At::default() });
            Ok(Self {
                is_friction: at(1.0) != at(0.0),
                formula: *formula,
                numbers,
            })
        });
        law.transpose()
    }

    /// Its torque \[N m\].
    pub fn at(&self, at: At) -> f64 {
        (self.formula)(&self.numbers, at)
    }
}

#[cfg(test)]
mod tests {
    use super::{At, DRY, Entry, Law, SMOOTH};

    #[track_caller]
    fn assert_at(table: &[Entry], effect: &str, numbers: &[f64], at: At, wanted: f64) {
        let mut left = numbers.iter().copied();
        let law = Law::of(table, effect, &mut |_| Ok(left.next().unwrap()));
        let found = law.unwrap().unwrap().at(at);
        assert_eq!(left.next(), None);
        assert!(
            (found - wanted).abs() < 1e-12,
            "{effect}: {found}, not {wanted}"
        );
    }

    #[test]
    fn forces_follow_their_formulas() {
        let [q, t] = [0.3, 1.0];
        let (fast, back) = (
            At {
                q,
                t,
                v: 2.0,
                ..At::default()
            },
            At {
                q,
                t,
                v: -2.0,
                ..At::default()
            },
        );
        for (effect, numbers, at, wanted) in [
            ("viscous_friction", [0.5].as_slice(), fast, -1.0),
            ("asymmetric_friction", &[0.5, 0.2], fast, -1.0),
            ("asymmetric_friction", &[0.5, 0.2], back, 0.4),
            ("quadratic_drag", &[0.5], back, 2.0),
            ("cubic_damping", &[0.5], back, 4.0),
            ("joint_spring", &[2.0, 0.5], fast, 0.4),
            ("stiffening_spring", &[2.0, 0.5, 10.0], fast, 0.48),
            ("constant_torque", &[0.1], fast, 0.1),
            (
                "cogging_torque",
                &[0.1, 5.0, 0.2],
                fast,
                0.1 * 1.7_f64.sin(),
            ),
            ("periodic_disturbance", &[0.1, 0.25, 0.0], fast, 0.1),
            (
                "gear_ripple",
                &[0.1, 0.5, 5.0, 0.2],
                At { load: -0.4, ..fast },
                0.3 * 1.7_f64.sin(),
            ),
        ] {
            assert_at(SMOOTH, effect, numbers, at, wanted);
        }
    }

    #[test]
    fn friction_levels_follow_their_formulas() {
        let forward = At {
            q: 0.5,
            v: 0.3,
            load: -2.0,
            direction: 1.0,
            t: 0.0,
        };
        let backward = At {
            direction: -1.0,
            ..forward
        };
        let stribeck = 0.1 + 0.1 * (-1.0_f64).exp();
        for (effect, numbers, at, wanted) in [
            ("coulomb_friction", [0.1].as_slice(), forward, 0.1),
            ("stribeck_friction", &[0.1, 0.2, 0.3], forward, stribeck),
            ("asymmetric_friction", &[0.1, 0.2], forward, 0.1),
            ("asymmetric_friction", &[0.1, 0.2], backward, 0.2),
            ("load_friction", &[0.1], forward, 0.2),
            ("gear_friction", &[0.1, 0.3], forward, 0.6),
            ("gear_friction", &[0.1, 0.3], backward, 0.2),
            (
                "uneven_friction",
                &[0.1, 0.5],
                forward,
                0.1 * (1.0 + 0.5 * 0.5_f64.sin()),
            ),
        ] {
            assert_at(DRY, effect, numbers, at, wanted);
        }
    }
}
