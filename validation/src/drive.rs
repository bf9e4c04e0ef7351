/// A drive between commanded and acting torque: delay, first-order lag, then the nonlinearities of [`Shape`] in the order of its fields.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Drive {
    /// \[s\], not necessarily whole steps.
    pub delay: f64,
    /// Time constant \[s\]; 0 for none.
    pub lag: f64,
    pub shape: Shape,
}

/// Static nonlinearities of a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Relative error of the gain.
    pub gain: f64,
    /// Half width of the dead zone \[N m\].
    pub deadzone: f64,
    /// Largest torque \[N m\].
    pub limit: f64,
    /// Decrease of the limit with speed in the direction of the torque \[N m s/rad\].
    pub back_emf: f64,
    /// Speed at which nothing is left of the limit, whichever way the joint moves \[rad/s\].
    pub no_load_speed: f64,
}

impl Default for Shape {
    fn default() -> Self {
        Self {
            gain: 0.0,
            deadzone: 0.0,
            limit: f64::INFINITY,
            back_emf: 0.0,
            no_load_speed: f64::INFINITY,
        }
    }
}

impl Shape {
    /// Acting torque \[N m\] for a commanded `torque` while the motor turns at `v` \[rad/s\].
    pub fn at(&self, torque: f64, v: f64) -> f64 {
        let torque = (1.0 + self.gain) * torque;
        let size = (torque.abs() - self.deadzone).max(0.0);
        let falls = self.back_emf * (v * torque.signum()).max(0.0);
        let left = (1.0 - v.abs() / self.no_load_speed).max(0.0);
        size.min((self.limit - falls).max(0.0) * left)
            .copysign(torque)
    }
}

/// The lagged torque between two changes of the command: it approaches `target` exponentially.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Approach {
    /// Time of the last change \[s\].
    pub since: f64,
    /// Torque at that time \[N m\].
    pub from: f64,
    pub target: f64,
}

impl Approach {
    pub fn at(&self, time: f64, lag: f64) -> f64 {
        if lag > 0.0 {
            self.target + (self.from - self.target) * (-(time - self.since) / lag).exp()
        } else {
            self.target
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Approach, Shape};

    fn shape(change: impl Fn(&mut Shape)) -> Shape {
        let mut shape = Shape::default();
        change(&mut shape);
        shape
    }

    #[test]
    fn an_ideal_drive_passes_the_command_through() {
        assert_eq!(Shape::default().at(-1.5, 3.0), -1.5);
        assert_eq!(Shape::default().at(0.0, 3.0), 0.0);
    }

    #[test]
    fn gain_deadzone_and_saturation_follow_their_formulas() {
        assert_eq!(shape(|s| s.gain = 0.5).at(-2.0, 0.0), -3.0);
        let deadzone = shape(|s| s.deadzone = 0.5);
        assert_eq!(
            [-2.0, -0.4, 0.4, 2.0].map(|u| deadzone.at(u, 0.0)),
            [-1.5, 0.0, 0.0, 1.5]
        );
        let limited = shape(|s| s.limit = 1.0);
        assert_eq!(
            [-2.0, 0.4, 2.0].map(|u| limited.at(u, 9.0)),
            [-1.0, 0.4, 1.0]
        );
    }

    #[test]
    fn the_limit_falls_with_speed_when_the_motor_drives_not_when_it_brakes() {
        let motor = shape(|s| (s.limit, s.back_emf) = (2.0, 0.25));
        assert_eq!(motor.at(3.0, 4.0), 1.0);
        assert_eq!(motor.at(-3.0, 4.0), -2.0);
        assert_eq!(motor.at(3.0, 40.0), 0.0);
    }

    #[test]
    fn nothing_is_left_of_the_limit_at_the_no_load_speed() {
        let motor = shape(|s| (s.limit, s.no_load_speed) = (2.0, 8.0));
        assert_eq!(motor.at(3.0, 4.0), 1.0);
        assert_eq!(motor.at(-3.0, 4.0), -1.0);
        assert_eq!(motor.at(0.5, 4.0), 0.5);
        assert_eq!(motor.at(3.0, 9.0), 0.0);
    }

    #[test]
    fn a_lag_has_covered_63_percent_after_its_time_constant() {
        let step = Approach {
            since: 1.0,
            from: 0.0,
            target: 2.0,
        };
        assert!((step.at(1.01, 0.01) - 2.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
        assert_eq!(step.at(1.01, 0.0), 2.0);
    }
}
