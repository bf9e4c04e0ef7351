/// Presliding friction: bristles that bend before they slip, a spring in small motion (Dahl 1968), with damping and with a
/// level that is higher near standstill (LuGre, Canudas de Wit et al. 1995).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Presliding {
    /// Torque when slipping fast \[N m\].
    pub level: f64,
    /// Stiffness of the bristles \[N m/rad\].
    pub stiffness: f64,
    /// Damping of the bristles \[N m s/rad\].
    pub damping: f64,
    pub stribeck: Option<Stribeck>,
}

/// How much more torque slow slip takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Stribeck {
    /// At standstill \[N m\].
    pub excess: f64,
    /// Speed at which 37 % of it are left \[rad/s\].
    pub speed: f64,
}

impl Presliding {
    /// Torque on the joint with bristles bent by `bristle` rad, at joint speed `v` \[rad/s\].
    pub fn torque(&self, bristle: f64, v: f64) -> f64 {
        -self.stiffness * bristle - self.damping * self.rate(bristle, v)
    }

    /// Rate of the bristles' bend \[rad/s\] at joint speed `v` \[rad/s\].
    pub fn rate(&self, bristle: f64, v: f64) -> f64 {
        v - self.stiffness / self.level_at(v) * v.abs() * bristle
    }

    fn level_at(&self, v: f64) -> f64 {
        let stribeck = self.stribeck.iter();
        let excess = stribeck.map(|slow| slow.excess * (-(v / slow.speed).powi(2)).exp());
        self.level + excess.sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::{Presliding, Stribeck};

    #[test]
    fn bristles_are_a_spring_that_slips_at_the_friction_level() {
        let friction = Presliding {
            level: 0.2,
            stiffness: 10.0,
            ..Presliding::default()
        };
        assert_eq!(friction.rate(0.0, 0.5), 0.5);
        // At a deflection of level over stiffness the bristles saturate and transmit the level.
        assert!(friction.rate(0.02, 0.5).abs() < 1e-15);
        assert!((friction.torque(0.02, 0.5) + 0.2).abs() < 1e-15);
    }

    #[test]
    fn damped_bristles_that_slip_slowly_hold_more() {
        let friction = Presliding {
            level: 0.2,
            stiffness: 10.0,
            damping: 0.3,
            stribeck: Some(Stribeck {
                excess: 0.1,
                speed: 0.05,
            }),
        };
        // Bent by nothing, they resist by their damping alone.
        assert!((friction.torque(0.0, 0.5) + 0.15).abs() < 1e-15);
        assert!(friction.rate(0.03, 1e-6).abs() < 1e-12);
        assert!(friction.rate(0.02, 5.0).abs() < 1e-12);
    }
}
