/// The transmission between a motor, which has its own inertia, and the link: a spring-damper with play. Stiff with play,
/// it is backlash; soft without play, it is an elastic joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Transmission {
    /// Free angle between the two contacts \[rad\].
    pub play: f64,
    /// Stiffness of the contacts \[N m/rad\].
    pub stiffness: f64,
    /// Damping of the contacts \[N m s/rad\].
    pub damping: f64,
    /// Inertia of the motor, reflected to the joint \[kg m^2\].
    pub inertia: f64,
    /// Whether the encoder is on the motor, not on the link.
    pub has_encoder: bool,
    /// Whether the motor counts as a part of its link, with which it turns on average: who hides the play says nothing of it.
    pub is_lumped: bool,
}

/// Contact stiffness of a gear: half a milliradian under 1 N m.
const CONTACT_STIFFNESS: f64 = 2000.0;
/// Damping ratio of motor and contact, as a share of critical damping.
const DAMPING_RATIO: f64 = 0.3;
/// Reflected rotor inertia of a small geared motor.
const ROTOR_INERTIA: f64 = 0.002;

/// The damping of a motor on a spring \[N m s/rad\].
fn damping(stiffness: f64, inertia: f64) -> f64 {
    2.0 * DAMPING_RATIO * (stiffness * inertia).sqrt()
}

impl Transmission {
    /// Two-sided play of `play` rad behind a small motor.
    pub fn backlash(play: f64) -> Self {
        Self {
            is_lumped: true,
            ..Self::with_play(play, ROTOR_INERTIA, true)
        }
    }

    /// A shaft that gives by `compliance` rad/(N m) behind a small motor.
    pub fn giving(compliance: f64) -> Self {
        let stiffness = 1.0 / compliance;
        Self {
            stiffness,
            damping: damping(stiffness, ROTOR_INERTIA),
            ..Self::backlash(0.0)
        }
    }

    /// Two-sided play of `play` rad behind a motor of this inertia.
    pub fn with_play(play: f64, inertia: f64, has_encoder: bool) -> Self {
        Self {
            play,
            stiffness: CONTACT_STIFFNESS,
            damping: damping(CONTACT_STIFFNESS, inertia),
            inertia,
            has_encoder,
            is_lumped: false,
        }
    }

    /// Torque on the link \[N m\] when the motor leads by `ahead` rad and the lead grows at `gaining` rad/s. Contacts
    /// push and never pull.
    pub fn torque(&self, ahead: f64, gaining: f64) -> f64 {
        let side = ahead.signum();
        let pressed = ahead.abs() - 0.5 * self.play;
        if self.play == 0.0 {
            return self.stiffness * ahead + self.damping * gaining;
        }
        if pressed <= 0.0 {
            return 0.0;
        }
        side * (self.stiffness * pressed + self.damping * side * gaining).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::Transmission;

    #[test]
    fn backlash_has_a_dead_band_and_contacts_only_push() {
        let gear = Transmission::backlash(0.01);
        assert_eq!(gear.torque(0.0049, 5.0), 0.0);
        assert_eq!(gear.torque(-0.0049, -5.0), 0.0);
        assert!((gear.torque(0.0055, 0.0) - 1.0).abs() < 1e-9);
        assert!((gear.torque(-0.0055, 0.0) + 1.0).abs() < 1e-9);
        assert_eq!(gear.torque(0.0055, -100.0), 0.0);
    }

    #[test]
    fn a_soft_shaft_is_a_spring_in_both_directions() {
        let shaft = Transmission {
            play: 0.0,
            stiffness: 30.0,
            damping: 0.2,
            inertia: 0.01,
            has_encoder: true,
            is_lumped: false,
        };
        assert!((shaft.torque(0.1, 0.0) - 3.0).abs() < 1e-12);
        assert!((shaft.torque(0.1, -1.0) - 2.8).abs() < 1e-12);
        assert!((shaft.torque(-0.1, 0.0) + 3.0).abs() < 1e-12);
    }
}
