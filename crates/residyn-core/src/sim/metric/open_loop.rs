use std::borrow::Cow;

use rayon::prelude::*;

use super::assessment::{Assessment, OpenLoop, WindowError};
use super::summary::{Summary, summarise};
use crate::data::{Log, SAME_S, half_width_s, row_after, row_from};
use crate::lanes::Row;
use crate::model::Dynamics;
use crate::sim::{
    Commands, PREDICTION_S, Point, RK4, Simulator, Steps, Window, initial_state, internal_along,
    with_own_angles,
};

/// Windows that are integrated side by side.
const LANES: usize = 8;
/// A prediction whose state exceeds this (rad, m, rad/s or m/s) has diverged.
const SENSIBLE: f64 = 1e4;
/// Largest relative change of a number at which the substeps are short enough.
const STEP_TOLERANCE: f64 = 1e-3;
/// Substeps are halved down to this, in s.
const SHORTEST_STEP_S: f64 = PREDICTION_S / 64.0;

/// The open-loop error of `dynamics` on `logs`, with the per-log values of each log.
///
/// Windows start every half horizon and last one horizon; their start states come from the log alone. The logged torque
/// is held over each step.
pub fn assess(dynamics: &Dynamics, logs: &[Log], horizons_s: &[f64]) -> Assessment {
    let models = in_logs(dynamics, logs);
    let replays = replays(&models, logs);
    let mut step_s = PREDICTION_S;
    let mut coarse = summarise(&run(&replays, horizons_s, step_s), dynamics.joints);
    loop {
        let horizons = run(&replays, horizons_s, step_s / 2.0);
        let fine = summarise(&horizons, dynamics.joints);
        let step_error = largest_change(&coarse, &fine);
        if step_error <= STEP_TOLERANCE || step_s / 2.0 <= SHORTEST_STEP_S {
            return Assessment {
                horizons,
                step_s: step_s / 2.0,
                step_error,
            };
        }
        coarse = fine;
        step_s /= 2.0;
    }
}

/// `replays` has one entry per log.
fn run(replays: &[Replay<'_>], horizons_s: &[f64], step_s: f64) -> Vec<OpenLoop> {
    let steps = Steps {
        scheme: RK4,
        longest_s: step_s,
    };
    let one = |&horizon_s: &f64| {
        let logs = replays.iter().map(|replay| replay.log);
        let all: Vec<Window> = all_windows(logs, horizon_s).collect();
        OpenLoop {
            horizon_s,
            windows: errors(replays, &all, steps),
        }
    };
    horizons_s.iter().map(one).collect()
}

/// The errors of a model in some windows, sorted by log, in such steps.
pub fn errors_in(
    dynamics: &Dynamics,
    logs: &[Log],
    windows: &[Window],
    steps: Steps,
) -> Vec<WindowError> {
    errors(&replays(&in_logs(dynamics, logs), logs), windows, steps)
}

/// The model in each log.
fn in_logs<'d>(dynamics: &'d Dynamics, logs: &[Log]) -> Vec<Cow<'d, Dynamics>> {
    logs.iter().map(|log| dynamics.in_log(log)).collect()
}

/// `models` gives the model in each log.
fn replays<'l>(models: &'l [Cow<'_, Dynamics>], logs: &'l [Log]) -> Vec<Replay<'l>> {
    let each = models.iter().zip(logs);
    each.map(|(model, log)| Replay::new(model, log)).collect()
}

/// `replays` has one entry per log.
fn errors(replays: &[Replay<'_>], windows: &[Window], steps: Steps) -> Vec<WindowError> {
    let packs: Vec<&[Window]> = windows
        .chunk_by(|a, b| a.log == b.log)
        .flat_map(|of_one_log| of_one_log.chunks(LANES))
        .collect();
    let errors: Vec<Vec<WindowError>> = packs
        .par_iter()
        .map(|pack| replays[pack[0].log].errors(pack, steps))
        .collect();
    errors.into_iter().flatten().collect()
}

/// Number of windows of `horizon_s` seconds in the logs.
pub fn window_count(logs: &[Log], horizon_s: f64) -> usize {
    all_windows(logs.iter(), horizon_s).count()
}

fn all_windows<'l>(
    logs: impl Iterator<Item = &'l Log>,
    horizon_s: f64,
) -> impl Iterator<Item = Window> {
    let each = logs.enumerate();
    each.flat_map(move |(index, log)| windows(index, log, horizon_s))
}

/// The windows of one log: one every half horizon, from the first row at which the state can be estimated.
pub fn windows(index: usize, log: &Log, horizon_s: f64) -> Vec<Window> {
    let half_width = half_width_s(log.median_step());
    let first = row_from(&log.time, log.time[0] + half_width);
    let Some(&begin) = log.time.get(first) else {
        return Vec::new();
    };
    let end_of_log = log.time[log.rows() - 1];
    starts(log, begin, horizon_s)
        .filter_map(|start| {
            let first = row_from(&log.time, start);
            let (from, to) = (log.time[first], log.time[first] + horizon_s);
            let last = row_after(&log.time, to) - 1;
            let touched = log.leave_out.iter().any(|span| span.touches(from, to));
            let whole = to <= end_of_log + SAME_S && last > first && !touched;
            (whole && initial_state(log, half_width, first).is_some()).then_some(Window {
                log: index,
                first,
                last,
            })
        })
        .collect()
}

/// The times at which windows start: every half horizon, as long as a horizon fits into the log. Starts that no row
/// follows within a horizon are skipped, so that a clock that jumps by years costs no time.
fn starts(log: &Log, begin: f64, horizon_s: f64) -> impl Iterator<Item = f64> {
    let half = horizon_s / 2.0;
    let end_of_log = log.time[log.rows() - 1] + SAME_S;
    let mut number = 0.0;
    std::iter::from_fn(move || {
        let mut start = begin + number * half;
        let next = log.time.get(row_from(&log.time, start))?;
        if *next > start + horizon_s {
            number = ((next - horizon_s - begin) / half).ceil();
            start = begin + number * half;
        }
        number += 1.0;
        (start + horizon_s <= end_of_log).then_some(start)
    })
}

/// A log and the model at its values in that log.
pub(super) struct Replay<'l> {
    pub model: Point<'l>,
    pub commands: Commands<'l>,
    log: &'l Log,
    /// The log with the rig's own angles, from which start states are estimated, and half the time span of that
    /// estimate, s.
    own: Cow<'l, Log>,
    half_width_s: f64,
    /// `[state][row]`
    internal: Vec<Vec<f64>>,
}

impl<'l> Replay<'l> {
    pub fn new(model: &'l Dynamics, log: &'l Log) -> Self {
        let model = Point::from(model);
        let commands = Commands::of_log(&model, log);
        let own = with_own_angles(&model, log);
        Self {
            internal: internal_along(&model, &own, &commands),
            commands,
            own,
            half_width_s: half_width_s(log.median_step()),
            model,
            log,
        }
    }

    /// The errors of up to [`LANES`] windows of the log, in such steps.
    fn errors(&self, pack: &[Window], steps: Steps) -> Vec<WindowError> {
        let (log, n) = (self.log, self.model.dynamics.joints);
        let commands = [&self.commands; LANES];
        let lane = |lane: usize| pack[lane.min(pack.len() - 1)];
        let mut simulator = Simulator::<LANES>::new(&self.model, steps.scheme);
        simulator.state = self.starts(pack);
        let mut errors: Vec<WindowError> =
            pack.iter().map(|w| WindowError::none(w, log, n)).collect();
        let rows = pack.iter().map(Window::rows).max().unwrap_or(0);
        for row in 0..rows - 1 {
            let at: [usize; LANES] =
                std::array::from_fn(|l| (lane(l).first + row).min(lane(l).last - 1));
            simulator.follow(commands, at, steps.longest_s);
            let counts = |l: usize| pack[l].first + row < pack[l].last;
            for l in (0..pack.len()).filter(|l| counts(*l)) {
                errors[l].hold(&mut simulator.state, l);
            }
            let shown = simulator.shown(commands, at.map(|row| row + 1));
            for l in (0..pack.len()).filter(|l| counts(*l)) {
                errors[l].add(shown, l, log, pack[l].first + row + 1);
            }
        }
        errors
    }

    /// The states (`[2n][lane]`) at the windows' starts; empty lanes repeat the last.
    fn starts(&self, pack: &[Window]) -> Vec<Row<f64, LANES>> {
        let starts: Vec<Vec<f64>> = pack.iter().map(|window| self.start(window)).collect();
        let of_lane = |k: usize, lane: usize| starts[lane.min(pack.len() - 1)][k];
        Row::table(self.model.dynamics.states(), of_lane)
    }

    /// The state at the window's start.
    pub fn start(&self, window: &Window) -> Vec<f64> {
        let motion = initial_state(&self.own, self.half_width_s, window.first);
        let mut state = motion.expect("windows() checks this");
        state.extend(self.internal.iter().map(|channel| channel[window.first]));
        state
    }
}

impl WindowError {
    fn none(window: &Window, log: &Log, joints: usize) -> Self {
        Self {
            log: window.log,
            start_s: log.time[window.first],
            rows: 0,
            position: vec![0.0; joints],
            velocity: vec![0.0; joints],
            diverged: false,
        }
    }

    /// Limit a state that has diverged, so that its error stays finite.
    fn hold(&mut self, state: &mut [Row<f64, LANES>], lane: usize) {
        for value in state.iter_mut() {
            let value = &mut value[lane];
            if !(value.abs() <= SENSIBLE) {
                self.diverged = true;
                *value = if value.is_nan() {
                    SENSIBLE
                } else {
                    value.clamp(-SENSIBLE, SENSIBLE)
                };
            }
        }
    }

    /// Add the errors of measured angles and velocities at a row of the log.
    fn add(
        &mut self,
        [angles, velocities]: [&[Row<f64, LANES>]; 2],
        lane: usize,
        log: &Log,
        row: usize,
    ) {
        self.rows += 1;
        for j in 0..self.position.len() {
            self.position[j] += (angles[j][lane] - log.q[j][row]).powi(2);
            self.velocity[j] += (velocities[j][lane] - log.qd[j][row]).powi(2);
        }
    }
}

fn largest_change(coarse: &Summary, fine: &Summary) -> f64 {
    let numbers = |of: &Summary| {
        [&of.position_rmse, &of.position_median, &of.velocity_rmse].map(|table| table.concat())
    };
    let pairs = (numbers(coarse).into_iter().flatten()).zip(numbers(fine).into_iter().flatten());
    pairs
        .map(|(a, b)| (a - b).abs() / b.abs().max(f64::MIN_POSITIVE))
        .fold(0.0, f64::max)
}
