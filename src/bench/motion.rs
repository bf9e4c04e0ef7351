//! Motion in fine steps: fourth-order steps while joints slide one way, halted exactly where one stops.

use super::drive::Approach;
use super::machine::{Directions, Machine, State};

/// Length of a step \[s\]: halving it changes nothing that a sensor could see (tested).
pub const STEP_S: f64 = 1e-4;
/// Halvings of a step by which the instant is found at which a joint stops.
const HALVINGS: usize = 40;

impl Machine {
    /// Move for `duration` s from time `from`, commands given, in steps of at most `step_s`.
    pub fn advance(
        &self,
        state: &mut State,
        from: f64,
        duration: f64,
        commands: &[Approach; 2],
        step_s: f64,
    ) {
        let mut passed = 0.0;
        // What is left below a femtosecond is rounding.
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

    /// A step of the classical fourth-order Runge-Kutta method.
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

/// The shortest length for which `has_happened`, which it has for `long`.
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
