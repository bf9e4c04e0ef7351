//! Event-driven integration: Runge-Kutta 4 steps between stick-slip events, each located by bisection.

use super::drive::Approach;
use super::machine::{Directions, Machine, State};

/// Step length \[s\]: halving it changes nothing that a sensor could resolve (tested below).
pub const STEP_S: f64 = 1e-4;
/// Number of bisections that locate the instant at which a joint stops.
const HALVINGS: usize = 40;

impl Machine {
    /// Integrates for `duration` s from time `from` under given commands, in steps of at most `step_s`.
    pub fn advance(
        &self,
        state: &mut State,
        from: f64,
        duration: f64,
        commands: &[Approach; 2],
        step_s: f64,
    ) {
        let mut passed = 0.0;
        // A remaining time below a femtosecond is rounding.
        while duration - passed > 1e-15 {
            let step = step_s.min(duration - passed);
            passed += self.step(state, from + passed, step, commands);
        }
    }

    /// One step, or the part of it until a joint stops; returns its length.
    fn step(&self, state: &mut State, time: f64, step: f64, commands: &[Approach; 2]) -> f64 {
        let directions = self.directions(time, state, commands);
        let after = |h: f64| self.smooth(time, state, h, commands, directions);
        let stops = |next: &State, j: usize| {
            self.has_dry_friction(j) && state.v[j] != 0.0 && directions[j] * next.v[j] <= 0.0
        };
        let whole = after(step);
        let mut length = step;
        let mut stopped = None;
        for j in 0..self.joints() {
            if stops(&after(length), j) {
                length = halve(length, |h| stops(&after(h), j));
                stopped = Some(j);
            }
        }
        let mut next = if stopped.is_some() {
            after(length)
        } else {
            whole
        };
        for j in 0..self.joints() {
            let left_backwards = state.v[j] == 0.0 && directions[j] * next.v[j] < 0.0;
            if stopped == Some(j) || left_backwards {
                next.v[j] = 0.0;
            }
        }
        *state = next;
        length
    }

    /// A step of the classical Runge-Kutta method of order 4.
    fn smooth(
        &self,
        t: f64,
        state: &State,
        h: f64,
        commands: &[Approach; 2],
        directions: Directions,
    ) -> State {
        let slope = |t: f64, state: &State| self.slope(t, state, commands, directions);
        let a = slope(t, state);
        let b = slope(t + 0.5 * h, &state.plus(&a, 0.5 * h));
        let c = slope(t + 0.5 * h, &state.plus(&b, 0.5 * h));
        let d = slope(t + h, &state.plus(&c, h));
        state
            .plus(&a, h / 6.0)
            .plus(&b, h / 3.0)
            .plus(&c, h / 3.0)
            .plus(&d, h / 6.0)
    }
}

/// The shortest length for which `has_happened` holds, as it does for `long`.
fn halve(long: f64, has_happened: impl Fn(f64) -> bool) -> f64 {
    let (mut short, mut long) = (0.0, long);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (short + long);
        if has_happened(middle) {
            long = middle;
        } else {
            short = middle;
        }
    }
    long
}

#[cfg(test)]
mod tests {
    use super::STEP_S;
    use crate::drive::Approach;
    use crate::machine::{Machine, State};
    use crate::mechanics::Mechanics;
    use crate::mechanics::tests::{double_pendulum, energy, pendulum};

    fn constant(torque: [f64; 2]) -> [Approach; 2] {
        torque.map(|target| Approach {
            target,
            ..Approach::default()
        })
    }

    fn moving(q: [f64; 2], v: [f64; 2]) -> State {
        State {
            q,
            v,
            ..State::at_rest(q)
        }
    }

    /// All kinds of friction and drives at once, for two seconds of swinging.
    fn end_of_a_rich_motion(step_s: f64) -> State {
        let stribeck = [("F_c", 0.3), ("F_s", 0.5), ("v_s", 0.2)];
        let machine = Machine::bare(double_pendulum())
            .hiding(0, "coulomb_friction", &[("F_c", 0.8)])
            .hiding(1, "stribeck_friction", &stribeck)
            .hiding(0, "viscous_friction", &[("b", 0.1)])
            .hiding(1, "actuator_lag", &[("T", 0.03)]);
        let mut state = moving([0.7, -0.4], [0.0, 2.0]);
        for (k, torque) in [[3.0, -1.0], [-4.0, 1.0], [0.0, 0.0], [2.0, 2.0]]
            .iter()
            .enumerate()
        {
            let mut commands = constant(*torque);
            commands[1].since = 0.5 * k as f64;
            machine.advance(&mut state, 0.5 * k as f64, 0.5, &commands, step_s);
        }
        state
    }

    #[test]
    fn halving_the_step_changes_less_than_a_sensor_resolves() {
        let (coarse, fine) = (
            end_of_a_rich_motion(STEP_S),
            end_of_a_rich_motion(0.5 * STEP_S),
        );
        for j in 0..2 {
            // A hundredth of the finest encoder's noise.
            assert!(
                (coarse.q[j] - fine.q[j]).abs() < 1e-6,
                "{coarse:?} {fine:?}"
            );
            assert!(
                (coarse.v[j] - fine.v[j]).abs() < 1e-5,
                "{coarse:?} {fine:?}"
            );
        }
    }

    #[test]
    fn without_friction_energy_grows_by_the_work_of_the_torques() {
        for (mechanics, torque) in [(pendulum(), [0.7, 0.0]), (double_pendulum(), [2.0, -1.5])] {
            let machine = Machine::bare(mechanics.clone());
            let mut state = moving([0.5, if torque[1] == 0.0 { 0.0 } else { -1.0 }], [0.3, 0.0]);
            let before = energy(&mechanics, state.q, state.v);
            let start = state.q;
            machine.advance(&mut state, 0.0, 3.0, &constant(torque), STEP_S);
            // The work of a constant torque depends only on the angle.
            let work: f64 = (0..2).map(|j| torque[j] * (state.q[j] - start[j])).sum();
            let gained = energy(&mechanics, state.q, state.v) - before;
            assert!((gained - work).abs() < 1e-8, "{gained} gained by {work}");
        }
    }

    #[test]
    fn static_friction_holds_a_joint_exactly() {
        let machine = Machine::bare(pendulum()).hiding(0, "coulomb_friction", &[("F_c", 0.5)]);
        let mut state = State::at_rest([0.1, 0.0]);
        // Gravity pulls by 0.294 N m.
        machine.advance(&mut state, 0.0, 2.0, &constant([0.79, 0.0]), STEP_S);
        assert_eq!((state.q[0], state.v[0]), (0.1, 0.0));
        machine.advance(&mut state, 2.0, 2.0, &constant([-0.2, 0.0]), STEP_S);
        assert_eq!((state.q[0], state.v[0]), (0.1, 0.0));
        machine.advance(&mut state, 4.0, 0.01, &constant([0.80, 0.0]), STEP_S);
        assert!(state.v[0] > 0.0);
    }

    #[test]
    fn a_sliding_joint_stops_where_friction_has_dissipated_its_energy() {
        let mechanics = Mechanics::Pendulum {
            inertia: 0.2,
            moment: 0.0,
            g: 9.81,
        };
        let machine = Machine::bare(mechanics).hiding(0, "coulomb_friction", &[("F_c", 0.3)]);
        let mut state = moving([1.0, 0.0], [-1.5, 0.0]);
        machine.advance(&mut state, 0.0, 2.0, &constant([0.0; 2]), STEP_S);
        let way = 0.5 * 0.2 * 1.5 * 1.5 / 0.3;
        assert_eq!(state.v[0], 0.0);
        assert!((state.q[0] - (1.0 - way)).abs() < 1e-9, "{}", state.q[0]);
    }

    #[test]
    fn asymmetric_friction_holds_more_one_way_than_the_other() {
        let friction = [("F_p", 0.5), ("F_n", 0.1), ("b_p", 0.0), ("b_n", 0.0)];
        let machine = Machine::bare(pendulum()).hiding(0, "asymmetric_friction", &friction);
        let moves = |torque: f64| {
            let mut state = State::at_rest([0.0; 2]);
            machine.advance(&mut state, 0.0, 0.01, &constant([torque, 0.0]), STEP_S);
            state.v[0]
        };
        assert_eq!(moves(0.49), 0.0);
        assert!(moves(0.51) > 0.0);
        assert_eq!(moves(-0.09), 0.0);
        assert!(moves(-0.11) < 0.0);
    }

    #[test]
    fn a_held_joint_transmits_its_reaction_to_the_moving_one() {
        let mechanics = double_pendulum();
        let rough = |level: f64| {
            let bare = Machine::bare(mechanics.clone());
            bare.hiding(1, "coulomb_friction", &[("F_c", level)])
        };
        let mut state = moving([0.8, 0.4], [0.0, 0.0]);
        let before = energy(&mechanics, state.q, state.v);
        rough(50.0).advance(&mut state, 0.0, 1.0, &constant([0.0; 2]), STEP_S);
        // A double pendulum with a locked elbow is a pendulum, without loss.
        assert_eq!((state.q[1], state.v[1]), (0.4, 0.0));
        assert!(state.v[0].abs() > 0.1);
        let after = energy(&mechanics, state.q, state.v);
        assert!((after - before).abs() < 1e-8);
        // With less friction the elbow slips during the swing.
        let mut state = moving([0.8, 0.4], [0.0, 0.0]);
        rough(0.2).advance(&mut state, 0.0, 1.0, &constant([0.0; 2]), STEP_S);
        assert!((state.q[1] - 0.4).abs() > 0.01);
    }

    #[test]
    fn presliding_friction_springs_back() {
        let machine = Machine::bare(pendulum())
            .hiding(0, "presliding", &[("F_c", 0.5), ("sigma_0", 20.0)])
            .hiding(0, "viscous_friction", &[("b", 2.0)]);
        let mut state = State::at_rest([0.0; 2]);
        machine.advance(&mut state, 0.0, 5.0, &constant([0.2, 0.0]), STEP_S);
        let pushed = state.q[0];
        assert!(pushed > 0.005, "{pushed}");
        machine.advance(&mut state, 5.0, 5.0, &constant([0.0, 0.0]), STEP_S);
        assert!(state.q[0] < 0.5 * pushed);
    }

    #[test]
    fn backlash_transmits_no_torque_within_its_play() {
        let machine = Machine::bare(pendulum()).hiding(0, "backlash", &[("delta", 0.02)]);
        let mut state = State::at_rest([0.0; 2]);
        machine.advance(&mut state, 0.0, 2e-3, &constant([0.5, 0.0]), STEP_S);
        assert_eq!(state.q[0], 0.0);
        // The motor alone: half of torque over inertia, times time squared.
        assert!((state.motor_q[0] - 0.5 * 0.5 / 0.002 * 4e-6).abs() < 1e-9);
        let machine = machine.hiding(0, "viscous_friction", &[("b", 1.0)]);
        machine.advance(&mut state, 2e-3, 10.0, &constant([0.5, 0.0]), STEP_S);
        let ahead = state.motor_q[0] - state.q[0];
        // Half of the play, plus the deflection of the contact.
        assert!((ahead - (0.01 + 0.5 / 2000.0)).abs() < 1e-6, "{ahead}");
        assert_eq!(machine.encoders(&state)[0], state.motor_q[0]);
        assert!((machine.declared()["C_i"] - 1.0 / 0.152).abs() < 1e-12);
    }
}
