/// Dry friction: a torque of a given level against the motion; at rest, whatever torque holds the joint, up to that
/// level.
#[derive(Debug, Clone, PartialEq)]
pub enum DryFriction {
    Coulomb {
        level: f64,
    },
    Stribeck {
        f_c: f64,
        f_s: f64,
        v_s: f64,
    },
    /// A level for each direction.
    Asymmetric {
        forward: f64,
        backward: f64,
    },
    /// Grows with the torque through the gear.
    Load {
        share: f64,
    },
    /// A level that varies over the angle.
    Uneven {
        level: f64,
        share: f64,
    },
}

impl DryFriction {
    /// The level \[N m\] against motion in `direction` (1 or -1), at angle `q` \[rad\], speed `v` \[rad/s\] and
    /// `load`, the torque through the gear \[N m\].
    pub fn level(&self, direction: f64, q: f64, v: f64, load: f64) -> f64 {
        match *self {
            Self::Coulomb { level } => level,
            Self::Stribeck { f_c, f_s, v_s } => f_c + (f_s - f_c) * (-(v / v_s).powi(2)).exp(),
            Self::Asymmetric { forward, backward } => {
                if direction > 0.0 {
                    forward
                } else {
                    backward
                }
            }
            Self::Load { share } => share * load.abs(),
            Self::Uneven { level, share } => level * (1.0 + share * q.sin()),
        }
    }
}

/// Presliding friction (Dahl 1968): bristles that bend before they slip, a spring in small motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Presliding {
    /// Torque when slipping \[N m\].
    pub level: f64,
    /// Stiffness of the bristles \[N m/rad\].
    pub stiffness: f64,
}

impl Presliding {
    /// Torque on the joint with bristles bent by `bristle` rad.
    pub fn torque(&self, bristle: f64) -> f64 {
        -self.stiffness * bristle
    }

    /// Rate of the bristles' bend \[rad/s\] at joint speed `v` \[rad/s\].
    pub fn rate(&self, bristle: f64, v: f64) -> f64 {
        v - self.stiffness / self.level * v.abs() * bristle
    }
}

#[cfg(test)]
mod tests {
    use super::{DryFriction, Presliding};

    #[test]
    fn friction_levels_follow_their_formulas() {
        let level = |friction: DryFriction, direction| friction.level(direction, 0.5, 0.3, -2.0);
        assert_eq!(level(DryFriction::Coulomb { level: 0.1 }, 1.0), 0.1);
        let stribeck = DryFriction::Stribeck {
            f_c: 0.1,
            f_s: 0.2,
            v_s: 0.3,
        };
        assert!((level(stribeck, 1.0) - (0.1 + 0.1 * (-1.0_f64).exp())).abs() < 1e-15);
        let asymmetric = DryFriction::Asymmetric {
            forward: 0.1,
            backward: 0.2,
        };
        assert_eq!(level(asymmetric.clone(), 1.0), 0.1);
        assert_eq!(level(asymmetric, -1.0), 0.2);
        assert_eq!(level(DryFriction::Load { share: 0.1 }, 1.0), 0.2);
        let uneven = DryFriction::Uneven {
            level: 0.1,
            share: 0.5,
        };
        assert!((level(uneven, 1.0) - 0.1 * (1.0 + 0.5 * 0.5_f64.sin())).abs() < 1e-15);
    }

    #[test]
    fn bristles_are_a_spring_that_slips_at_the_friction_level() {
        let friction = Presliding {
            level: 0.2,
            stiffness: 10.0,
        };
        assert_eq!(friction.rate(0.0, 0.5), 0.5);
        // At a deflection of level over stiffness the bristles saturate and transmit the level.
        assert!(friction.rate(0.02, 0.5).abs() < 1e-15);
        assert!((friction.torque(0.02) + 0.2).abs() < 1e-15);
    }
}
