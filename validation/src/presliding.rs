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
    use super::Presliding;

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
