use std::borrow::Cow;

use super::{Commands, Point, internal_along};
use crate::data::{Log, Thinning, Trajectory, half_width_s, local_cubic, trajectories};
use crate::expr::Tape;
use crate::lanes::Row;
use crate::model::InputLayout;

/// The position sensors of a model, for `W` trajectories: they measure the angles of the rig unless an effect, such as
/// backlash, acts between joint and sensor.
pub struct Sensors<const W: usize> {
    tape: Option<Tape<f64, W>>,
    joints: usize,
    layout: InputLayout,
    shown: Vec<Row<f64, W>>,
}

impl<const W: usize> Sensors<W> {
    /// The sensors of one model.
    pub fn new<'d>(model: impl Into<Point<'d>>) -> Self {
        let model = model.into();
        let joints = model.dynamics.joints;
        let layout = model.dynamics.layout();
        let reading = model.dynamics.reading.as_ref();
        Self {
            tape: reading.map(|reading| reading.tape_at(layout.parameters(), model.values())),
            joints,
            layout,
            shown: vec![Row::splat(0.0); joints],
        }
    }

    /// Set the value of a parameter in one lane.
    pub fn set_in_lane(&mut self, parameter: usize, lane: usize, value: f64) {
        let first = self.layout.parameters();
        if let Some(tape) = &mut self.tape {
            tape.inputs()[first + parameter][lane] = value;
        }
    }

    /// The angles (`[n][lane]`) measured in `state` (`[state][lane]`) at `time` (s). `given` (`[channel][lane]`) are the torques
    /// that acted until then, and the model's further measured columns.
    pub fn show<'s>(
        &'s mut self,
        state: &'s [Row<f64, W>],
        given: impl FnOnce() -> Vec<Row<f64, W>>,
        time: Row<f64, W>,
    ) -> &'s [Row<f64, W>] {
        let n = self.joints;
        let Some(tape) = &mut self.tape else {
            return &state[..n];
        };
        let (inputs, layout) = (tape.moving(), self.layout);
        inputs[layout.states()].copy_from_slice(state);
        inputs[layout.given()].copy_from_slice(&given());
        inputs[layout.time()] = time;
        tape.run();
        for (k, shown) in self.shown.iter_mut().enumerate() {
            *shown = *tape.output(k);
        }
        &self.shown
    }

    /// Replace the measured angles in `state` (`[state][lane]`) by those of the rig. Their difference is small, and is
    /// evaluated at the measured angles.
    pub fn correct(
        &mut self,
        state: &mut [Row<f64, W>],
        given: impl FnOnce() -> Vec<Row<f64, W>>,
        time: Row<f64, W>,
    ) {
        let seen = state.to_vec();
        let shown = self.show(&seen, given, time);
        for ((angle, shown), seen) in state.iter_mut().zip(shown).zip(&seen) {
            for lane in 0..W {
                angle[lane] -= shown[lane] - seen[lane];
            }
        }
    }
}

/// Number of iterations: the sensor effect may depend on velocities, which are estimated from the corrected angles.
const PASSES: usize = 5;

/// A log with measured angles replaced by those of the rig.
pub fn with_own_angles<'l, 'd>(model: impl Into<Point<'d>>, log: &'l Log) -> Cow<'l, Log> {
    let model = model.into();
    if model.dynamics.reading.is_none() {
        return Cow::Borrowed(log);
    }
    let commands = Commands::of_log(&model, log);
    let internal = internal_along(&model, log, &commands);
    let mut sensors = Sensors::<1>::new(model);
    let mut own = log.clone();
    for _ in 0..PASSES {
        let speeds = speeds(&own);
        for row in 0..log.rows() {
            let columns = log.q.iter().chain(&speeds).chain(&internal);
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

/// Velocities estimated from the angles, because reported velocities are noisy; as reported near the log's ends.
fn speeds(log: &Log) -> Vec<Vec<f64>> {
    // Twice as wide as for start states, so that a jump by the backlash does not reverse the sign of a velocity.
    let half_width = 2.0 * half_width_s(log.median_step());
    let speed = |q: &Vec<f64>, row: usize, reported: f64| {
        local_cubic(&log.time, q, row, half_width).map_or(reported, |cubic| cubic.slope)
    };
    (log.q.iter().zip(&log.qd))
        .map(|(q, qd)| (0..).zip(qd).map(|(row, v)| speed(q, row, *v)).collect())
        .collect()
}

/// The motions of a log as a model sees them, with its internal states along them: what it can be trained on.
pub fn motions<'d>(model: impl Into<Point<'d>>, log: &Log, thinning: Thinning) -> Vec<Trajectory> {
    let model = model.into();
    let own = with_own_angles(&model, log);
    let commands = Commands::of_log(&model, log);
    let internal = internal_along(&model, &own, &commands);
    trajectories(&commands.acting_on(&own), &internal, thinning)
}
