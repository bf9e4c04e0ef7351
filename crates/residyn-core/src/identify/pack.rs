//! Windows integrated side by side, one per lane.

use super::normal_equations::WindowTerms;
use super::sensitivity::{LANES, Lane, Tangent, TangentStepper};
use super::start::Start;
use super::sums::{Sums, loss};
use super::values::Values;
use crate::data::Log;
use crate::lanes::Row;
use crate::model::{Dependence, Dynamics};
use crate::sim::{
    Commands, Course, Hold, InternalRates, InternalStart, Point, Scheme, Simulator, Steps, Window,
    substeps,
};

/// What the logs give a model at some values of its parameters: filtered torques, and the course of its internal states
/// if it has any.
pub(super) struct Given<'l> {
    pub commands: Vec<Commands<'l>>,
    pub courses: Vec<Course>,
}

/// Up to [`LANES`] windows integrated side by side. Shorter windows are padded with steps of zero length and rows of
/// zero weight.
#[derive(Clone)]
pub(super) struct Pack {
    pub windows: Vec<usize>,
    /// The log of each lane.
    logs: [usize; LANES],
    /// `[row][lane]`: the row of the lane's log.
    at: Vec<[usize; LANES]>,
    time: Vec<Lane>,
    dt: Vec<Lane>,
    substeps: Vec<usize>,
    scheme: &'static Scheme,
    /// `[row][joint]`
    tau: Vec<Vec<Lane>>,
    pub q: Vec<Vec<Lane>>,
    /// `[row][joint]`: 1 / noise, or 0 if the lane has no such row or its log masks it.
    pub weight: Vec<Vec<Lane>>,
    /// `[angles, velocities]`: the logs' estimates of the start states, and 1 / standard deviation.
    start: Vec<Lane>,
    start_weight: Vec<Lane>,
}

impl Pack {
    pub fn new(
        logs: &[Log],
        windows: &[Window],
        members: &[usize],
        noise: &[f64],
        half_widths: &[f64],
    ) -> Self {
        let n = noise.len();
        let rows = members
            .iter()
            .map(|&w| windows[w].rows())
            .max()
            .unwrap_or(0);
        // Empty lanes repeat the last window, without weight.
        let window_of = |lane: usize| &windows[members[lane.min(members.len() - 1)]];
        let zeros = || vec![vec![Row::splat(0.0); n]; rows];
        let mut pack = Self {
            windows: members.to_vec(),
            logs: std::array::from_fn(|lane| window_of(lane).log),
            at: vec![[0; LANES]; rows],
            time: vec![Row::splat(0.0); rows],
            dt: vec![Row::splat(0.0); rows],
            substeps: Vec::new(),
            scheme: Steps::FIT.scheme,
            tau: zeros(),
            q: zeros(),
            weight: zeros(),
            start: vec![Row::splat(0.0); 2 * n],
            start_weight: vec![Row::splat(0.0); 2 * n],
        };
        for lane in 0..members.len() {
            let window = window_of(lane);
            let (log, half_width) = (&logs[window.log], half_widths[window.log]);
            let start = Start::of(log, window.first, half_width, noise);
            for k in 0..2 * n {
                pack.start[k][lane] = start.state[k];
                pack.start_weight[k][lane] = start.weight[k];
            }
        }
        for lane in 0..LANES {
            let window = window_of(lane);
            let log = &logs[window.log];
            for row in 0..rows {
                let at = (window.first + row).min(window.last);
                pack.at[row][lane] = at;
                pack.time[row][lane] = log.time[at];
                // Padding has steps of zero length.
                pack.dt[row][lane] = log.time[(at + 1).min(window.last)] - log.time[at];
                for j in 0..n {
                    pack.tau[row][j][lane] = log.held(j, at);
                    pack.q[row][j][lane] = log.q[j][at];
                    let masked = log.is_masked(j, at);
                    let counts = lane < members.len() && row < window.rows() && !masked;
                    pack.weight[row][j][lane] = if counts { 1.0 / noise[j] } else { 0.0 };
                }
            }
        }
        pack.cut(Steps::FIT);
        pack
    }

    /// Drop the logs' estimates of the start states.
    pub fn free_starts(&mut self) {
        self.start_weight.fill(Row::splat(0.0));
    }

    /// Cut the steps between rows into such substeps.
    pub fn cut(&mut self, steps: Steps) {
        let of_row = |dt| substeps(dt, steps.longest_s);
        self.substeps = self.dt.iter().map(of_row).collect();
        self.scheme = steps.scheme;
    }

    fn rows(&self) -> usize {
        self.time.len()
    }

    /// The local values of the pack's windows, one row per value.
    fn gather(&self, start_states: &[Vec<f64>]) -> Vec<Lane> {
        let lane_of = |lane: usize| &start_states[self.windows[lane.min(self.windows.len() - 1)]];
        Row::table(lane_of(0).len(), |k, lane| lane_of(lane)[k])
    }

    /// The hold from `row` to the next. `force` holds the windows' forces, if they have any.
    fn hold<'a>(
        &'a self,
        commands: &'a [Commands<'a>],
        row: usize,
        force: &'a [Lane],
    ) -> Hold<'a, LANES> {
        Hold {
            commands: self.logs.map(|log| &commands[log]),
            held: &self.tau[row],
            force,
            from: self.time[row],
            to: *self.time.get(row + 1).unwrap_or(&self.time[row]),
            length: self.dt[row],
            substeps: self.substeps[row],
        }
    }

    /// The torques that acted just before `row`, and the model's further measured columns.
    fn torque_before(&self, commands: &[Commands<'_>], row: usize) -> Vec<Lane> {
        Commands::just_before(self.logs.map(|log| &commands[log]), self.at[row])
    }

    /// The internal states at the windows' starts.
    fn internal_start(&self, given: &Given<'_>, pairs: &[Dependence]) -> InternalStart<LANES> {
        let course = |lane: usize| (&given.courses[self.logs[lane]], self.at[0][lane]);
        match given.courses.is_empty() {
            true => InternalStart::default(),
            false => InternalStart::of(std::array::from_fn(course), pairs),
        }
    }

    /// Integrate the windows, calling `see(row, angles)` with the measured angles at each row.
    pub fn roll(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        given: &Given<'_>,
        start_states: &[Vec<f64>],
        mut see: impl FnMut(usize, &[Lane]),
    ) {
        let mut state = self.gather(start_states);
        let forces = state.split_off(2 * dynamics.joints);
        state.extend(self.internal_start(given, &[]).values);
        let commands = &given.commands;
        let model = Point::new(dynamics, values.common.as_slice());
        let mut simulator = Simulator::<LANES>::new(&model, self.scheme);
        simulator.state = state;
        values.by_lane(&self.logs, |parameter, lane, value| {
            simulator.set_in_lane(parameter, lane, value);
        });
        for row in 0..self.rows() {
            let at = self.logs.map(|log| &commands[log]);
            let [angles, _] = simulator.shown(at, self.at[row]);
            see(row, angles);
            simulator.advance(&self.hold(commands, row, &forces));
        }
    }

    /// The Huber loss of each window at residual scale `scale`, including its start state; not finite if the model
    /// diverges.
    pub fn costs(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        given: &Given<'_>,
        start_states: &[Vec<f64>],
        scale: f64,
    ) -> Vec<(usize, f64)> {
        let n = dynamics.joints;
        let mut costs: Vec<(usize, f64)> = self.windows.iter().map(|&w| (w, 0.0)).collect();
        self.roll(dynamics, values, given, start_states, |row, angles| {
            for (lane, (window, cost)) in costs.iter_mut().enumerate() {
                let velocities = &start_states[*window][n..];
                for j in 0..n {
                    let weight = self.weight[row][j][lane] / scale;
                    *cost += loss((angles[j][lane] - self.q[row][j][lane]) * weight).0;
                    if row == 0 {
                        let from_start = |k: usize, value: f64| {
                            loss((value - self.start[k][lane]) * self.start_weight[k][lane]).0
                        };
                        *cost += from_start(j, angles[j][lane]);
                        *cost += from_start(n + j, velocities[j]);
                    }
                }
            }
        });
        costs
    }

    pub fn linearise(
        &self,
        tangent: &Tangent,
        values: &Values,
        given: &Given<'_>,
        start_states: &[Vec<f64>],
        scale: f64,
    ) -> Vec<(usize, WindowTerms)> {
        let commands = &given.commands;
        let (n, columns) = (tangent.joints, tangent.columns());
        let states = self.gather(start_states);
        let mut sums = Sums::new(columns);
        let mut stepper = TangentStepper::new(tangent, &values.common, self.scheme);
        values.by_lane(&self.logs, |parameter, lane, value| {
            stepper.set_in_lane(parameter, lane, value);
        });
        let pairs = tangent
            .internal
            .as_ref()
            .map_or(&[][..], InternalRates::pairs);
        stepper.start(&states, &self.internal_start(given, pairs));
        for row in 0..self.rows() {
            let before = || self.torque_before(commands, row);
            let (angles, slopes) = stepper.shown(before, self.time[row]);
            for j in 0..n {
                let weight = Row(self.weight[row][j].map(|w| w / scale));
                let residual = Row::from_fn(|l| (angles[j][l] - self.q[row][j][l]) * weight[l]);
                sums.add(&residual, &slopes[j * columns..][..columns], &weight);
            }
            if row == 0 {
                self.add_starts(&mut sums, tangent, (angles, slopes), &states);
            }
            stepper.advance(&self.hold(commands, row, &states[2 * n..]));
        }
        let terms = sums.lanes(self.windows.len());
        self.windows.iter().copied().zip(terms).collect()
    }

    /// Add the distance of the start states from the logs' estimates. It has the sensor's scale, not that of the
    /// residuals: the worse a model is, the less it may move its start states.
    fn add_starts(
        &self,
        sums: &mut Sums,
        tangent: &Tangent,
        (angles, slopes): (&[Lane], &[Lane]),
        states: &[Lane],
    ) {
        let (n, columns) = (tangent.joints, tangent.columns());
        let mut own = vec![Row::splat(0.0); columns];
        for j in 0..n {
            let mut add = |k: usize, value: &Lane, slopes: &[Lane]| {
                let (estimate, weight) = (self.start[k], self.start_weight[k]);
                let residual = Row::from_fn(|l| (value[l] - estimate[l]) * weight[l]);
                sums.add(&residual, slopes, &weight);
            };
            add(j, &angles[j], &slopes[j * columns..][..columns]);
            let velocity = tangent.active.len() + n + j;
            own[velocity] = Row::splat(1.0);
            add(n + j, &states[n + j], &own);
            own[velocity] = Row::splat(0.0);
        }
    }
}
