use std::f64::consts::TAU;

/// A torque that varies smoothly with the motion of its joint \[N m\].
#[derive(Debug, Clone, PartialEq)]
pub enum Force {
    Viscous {
        b: f64,
    },
    /// Viscous friction with a different slope in each direction.
    TwoSlopes {
        b_p: f64,
        b_n: f64,
    },
    /// Grows as the logarithm of the speed far above the bend.
    Degressive {
        rise: f64,
        bend: f64,
    },
    QuadraticDrag {
        c: f64,
    },
    CubicDamping {
        c: f64,
    },
    Spring {
        k: f64,
        q_0: f64,
    },
    Constant {
        tau_0: f64,
    },
    /// Ripple over the angle; the ripple of an effect file has a whole number of periods per turn.
    Ripple {
        amplitude: f64,
        periods: f64,
        phase: f64,
    },
    /// Ripple over time.
    Hum {
        amplitude: f64,
        frequency_hz: f64,
        phase: f64,
    },
}

impl Force {
    /// At angle `q` \[rad\], speed `v` \[rad/s\] and time `t` \[s\].
    pub fn at(&self, q: f64, v: f64, t: f64) -> f64 {
        match *self {
            Self::Viscous { b } => -b * v,
            Self::TwoSlopes { b_p, b_n } => -v * if v > 0.0 { b_p } else { b_n },
            Self::Degressive { rise, bend } => -rise * (v / bend).asinh(),
            Self::QuadraticDrag { c } => -c * v * v.abs(),
            Self::CubicDamping { c } => -c * v * v * v,
            Self::Spring { k, q_0 } => -k * (q - q_0),
            Self::Constant { tau_0 } => tau_0,
            Self::Ripple {
                amplitude,
                periods,
                phase,
            } => amplitude * (periods * q + phase).sin(),
            Self::Hum {
                amplitude,
                frequency_hz,
                phase,
            } => amplitude * (TAU * frequency_hz * t + phase).sin(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Force;

    #[track_caller]
    fn assert_at(force: &Force, at: [f64; 3], wanted: f64) {
        let found = force.at(at[0], at[1], at[2]);
        assert!(
            (found - wanted).abs() < 1e-12,
            "{force:?}: {found}, not {wanted}"
        );
    }

    #[test]
    fn forces_follow_their_formulas() {
        assert_at(&Force::Viscous { b: 0.5 }, [0.3, 2.0, 0.0], -1.0);
        let slopes = Force::TwoSlopes { b_p: 0.5, b_n: 0.2 };
        assert_at(&slopes, [0.3, 2.0, 0.0], -1.0);
        assert_at(&slopes, [0.3, -2.0, 0.0], 0.4);
        assert_at(&Force::QuadraticDrag { c: 0.5 }, [0.3, -2.0, 0.0], 2.0);
        assert_at(&Force::CubicDamping { c: 0.5 }, [0.3, -2.0, 0.0], 4.0);
        assert_at(&Force::Spring { k: 2.0, q_0: 0.5 }, [0.3, 9.0, 0.0], 0.4);
        assert_at(&Force::Constant { tau_0: 0.1 }, [0.3, 9.0, 0.0], 0.1);
        let ripple = Force::Ripple {
            amplitude: 0.1,
            periods: 5.0,
            phase: 0.2,
        };
        assert_at(&ripple, [0.3, 9.0, 0.0], 0.1 * 1.7_f64.sin());
        let hum = Force::Hum {
            amplitude: 0.1,
            frequency_hz: 0.25,
            phase: 0.0,
        };
        assert_at(&hum, [0.3, 9.0, 1.0], 0.1);
    }
}
