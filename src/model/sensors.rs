use std::borrow::Cow;

use super::{Commands, Dynamics};
use crate::data::{Log, half_width_s, local_cubic};
use crate::expr::Tape;
use crate::lanes::Row;

/// What the sensors of a model show of `W` trajectories: the angles of the rig itself unless an effect stands between
/// joint and sensor.
pub struct Sensors<'d, const W: usize> {
    tape: Option<Tape<'d, f64, W>>,
    joints: usize,
    shown: Vec<Row<f64, W>>,
}

impl<'d, const W: usize> Sensors<'d, W> {
    /// The sensors of `dynamics` with parameters `values`, in its order.
    pub fn new(dynamics: &'d Dynamics, values: &[f64]) -> Self {
        let joints = dynamics.joints;
        let mut tape = dynamics.reading.as_ref().map(|reading| reading.tape());
        if let Some(tape) = &mut tape {
            let own = &mut tape.inputs()[3 * joints + 1..];
            for (slot, value) in own.iter_mut().zip(values) {
                *slot = Row::splat(*value);
            }
        }
        Self {
            tape,
            joints,
            shown: vec![Row::splat(0.0); joints],
        }
    }

    /// Let a parameter have another value in one lane.
    pub fn set_in_lane(&mut self, parameter: usize, lane: usize, value: f64) {
        let first = 3 * self.joints + 1;
        if let Some(tape) = &mut self.tape {
            tape.inputs()[first + parameter][lane] = value;
        }
    }

    /// The angles (`[n][lane]`) shown of `state` (`[2n][lane]`) at `time` (s), when the torque until then was `tau`
    /// (`[n][lane]`).
    pub fn show<'s>(
        &'s mut self,
        state: &'s [Row<f64, W>],
        tau: impl FnOnce() -> Vec<Row<f64, W>>,
        time: Row<f64, W>,
    ) -> &'s [Row<f64, W>] {
        let n = self.joints;
        let Some(tape) = &mut self.tape else {
            return &state[..n];
        };
        let inputs = tape.inputs();
        inputs[..2 * n].copy_from_slice(state);
        inputs[2 * n..3 * n].copy_from_slice(&tau());
        inputs[3 * n] = time;
        tape.run();
        for (k, shown) in self.shown.iter_mut().enumerate() {
            *shown = *tape.output(k);
        }
        &self.shown
    }

    /// Put the rig's own angles in place of those that sensors show in `state`. What stands between is small, and is
    /// taken at the angles shown.
    pub fn correct(
        &mut self,
        state: &mut [Row<f64, W>],
        tau: impl FnOnce() -> Vec<Row<f64, W>>,
        time: Row<f64, W>,
    ) {
        let seen = state.to_vec();
        let shown = self.show(&seen, tau, time);
        for ((angle, shown), seen) in state.iter_mut().zip(shown).zip(&seen) {
            for lane in 0..W {
                angle[lane] -= shown[lane] - seen[lane];
            }
        }
    }
}

/// What stands between may depend on velocities, which come from the angles found: so often they are found anew.
const PASSES: usize = 5;

/// A log with the angles of the rig itself in place of those that sensors show, by a model with parameters `values`.
pub fn with_own_angles<'l>(dynamics: &Dynamics, values: &[f64], log: &'l Log) -> Cow<'l, Log> {
    if dynamics.reading.is_none() {
        return Cow::Borrowed(log);
    }
    let commands = Commands::of_log(dynamics, values, log);
    let mut sensors = Sensors::<1>::new(dynamics, values);
    let mut own = log.clone();
    for _ in 0..PASSES {
        let speeds = speeds(&own);
        for row in 0..log.rows() {
            let columns = log.q.iter().chain(&speeds);
            let mut state: Vec<Row<f64, 1>> = columns.map(|column| Row([column[row]])).collect();
            let before = || Commands::just_before([&commands], [row]);
            sensors.correct(&mut state, before, Row([log.time[row]]));
            for (column, angle) in own.q.iter_mut().zip(&state) {
                column[row] = angle[0];
            }
        }
    }
    Cow::Owned(own)
}

/// Velocities from the angles, as those that rigs report are noisy; near the log's ends as reported.
fn speeds(log: &Log) -> Vec<Vec<f64>> {
    // Twice as wide as for start states: a jump by the play beside a row must not turn the sign of its velocity.
    let half_width = 2.0 * half_width_s(log.median_step());
    let speed = |q: &Vec<f64>, row: usize, reported: f64| {
        local_cubic(&log.time, q, row, half_width).map_or(reported, |cubic| cubic.slope)
    };
    (log.q.iter().zip(&log.qd))
        .map(|(q, qd)| (0..).zip(qd).map(|(row, v)| speed(q, row, *v)).collect())
        .collect()
}

/// A log as a model sees it: with the angles of the rig itself, and the torques that act.
#[must_use]
pub fn as_modelled(dynamics: &Dynamics, values: &[f64], log: &Log) -> Log {
    let own = with_own_angles(dynamics, values, log);
    Commands::of_log(dynamics, values, log).acting_on(&own)
}
