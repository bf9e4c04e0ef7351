//! Effects with memory between a commanded torque and the torque that acts: pure filters of the command,
//! independent of the rig's state.

use serde::{Deserialize, Serialize};

use super::Dynamics;
use crate::data::{Joint, Log};
use crate::lanes::Row;

/// How a command is filtered; each kind has one parameter, in s. At zero both leave the command as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CommandFilter {
    /// tau(t) -> tau(t - d)
    Delay,
    /// T dtau/dt + tau = commanded
    Lag,
}

impl CommandFilter {
    /// The filter of `tau` with its `parameter`, as text.
    pub fn expression(self, tau: &str, parameter: &str) -> String {
        match self {
            Self::Delay => format!("{tau}(t - {parameter})"),
            Self::Lag => format!("{parameter} * d({tau})/dt + {tau} = commanded"),
        }
    }

    /// The same in LaTeX.
    pub fn latex(self, tau: &str, parameter: &str) -> String {
        match self {
            Self::Delay => format!("{tau}\\left(t - {parameter}\\right)"),
            Self::Lag => format!("{parameter} \\,\\dot{{{tau}}} + {tau} = \\text{{commanded}}"),
        }
    }
}

/// A filter of one joint's commanded torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Filter {
    pub joint: Joint,
    pub kind: CommandFilter,
    /// Index into the model's parameters.
    pub parameter: usize,
}

/// What the filters of a model make of one history of commanded torques.
///
/// Between the rows of the history the command is held; before the first row it was that row's for ever,
/// after the last it stays. Filters are linear, so that a delay and a lag on one joint have no order.
#[derive(Debug, Clone)]
pub struct Commands<'l> {
    time: &'l [f64],
    tau: &'l [Vec<f64>],
    joints: usize,
    /// Filters of the model: what each stands for in the outputs of [`Commands::slopes`].
    filters: Vec<Filter>,
    /// For each joint the filtered history, where there is a filter.
    histories: Vec<Option<History<'l>>>,
}

/// The torque over one part of a step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Mean {
    /// In N m (or N).
    value: f64,
    /// Derivatives of the value by the delay and the time constant, per s.
    by_delay: f64,
    by_lag: f64,
}

impl<'l> Commands<'l> {
    /// The filters of `dynamics` with parameters `values`, in its order, acting on torques `tau` (`[joint][row]`)
    /// that are held from `time[row]` (s) on.
    pub fn new(dynamics: &Dynamics, values: &[f64], time: &'l [f64], tau: &'l [Vec<f64>]) -> Self {
        let history = |joint: Joint| {
            let own = |kind: CommandFilter| {
                let mut filters = dynamics.filters.iter();
                filters.find(|filter| filter.joint == joint && filter.kind == kind)
            };
            let (delay, lag) = (own(CommandFilter::Delay), own(CommandFilter::Lag));
            let value = |filter: Option<&Filter>| filter.map_or(0.0, |f| values[f.parameter]);
            (delay.is_some() || lag.is_some())
                .then(|| History::new(time, &tau[joint], value(delay), value(lag)))
        };
        Self {
            time,
            tau,
            joints: dynamics.joints,
            filters: dynamics.filters.clone(),
            histories: Joint::all(dynamics.joints).map(history).collect(),
        }
    }

    /// The same for a log.
    pub fn of_log(dynamics: &Dynamics, values: &[f64], log: &'l Log) -> Self {
        Self::new(dynamics, values, &log.time, &log.tau)
    }

    /// The torque (`[joint][lane]`) that acted until a row of each history.
    pub fn just_before<const W: usize>(commands: [&Self; W], rows: [usize; W]) -> Vec<Row<f64, W>> {
        let of_lane = |joint: usize, lane: usize| {
            let (own, row) = (commands[lane], rows[lane]);
            match &own.histories[joint] {
                Some(history) => history.at(own.time[row]).output,
                None => own.tau[joint][row.saturating_sub(1)],
            }
        };
        (0..commands[0].joints)
            .map(|joint| Row(std::array::from_fn(|lane| of_lane(joint, lane))))
            .collect()
    }

    /// The log with the torque that acts in place of the commanded one: its mean from each row to the next.
    #[must_use]
    pub fn acting_on(&self, log: &Log) -> Log {
        let mut acting = log.clone();
        for (history, tau) in self.histories.iter().zip(&mut acting.tau) {
            let Some(history) = history else { continue };
            for (tau, ends) in tau.iter_mut().zip(log.time.windows(2)) {
                *tau = history.mean(ends[0], ends[1]).value;
            }
        }
        acting
    }
}

/// The torque over a step of `W` trajectories: mean and slopes over each of the step's equal parts.
#[derive(Debug, Clone, Default)]
pub struct StepTorque<const W: usize> {
    /// `[part * n + joint][lane]`, in N m (or N). Without filters one part stands for the whole step.
    pub mean: Vec<Row<f64, W>>,
    /// `[part * filters + filter][lane]`: derivative of the mean on the filter's joint by its parameter.
    pub slopes: Vec<Row<f64, W>>,
}

impl<const W: usize> StepTorque<W> {
    /// From `from` to `to` (s), one each lane, in `parts` equal parts. `held` (`[joint][lane]`) is the command over
    /// the step: it acts on joints without a filter.
    ///
    /// Means over parts make an integration with parts accurate to second order in their length, wherever between
    /// them the torque jumps, and its result smooth in the filters' parameters.
    pub fn new(
        commands: [&Commands<'_>; W],
        held: &[Row<f64, W>],
        from: Row<f64, W>,
        to: Row<f64, W>,
        parts: usize,
    ) -> Self {
        let mut torque = Self::default();
        torque.fill(commands, held, from, to, parts);
        torque
    }

    /// As [`StepTorque::new`], in the memory of a step before.
    pub fn fill(
        &mut self,
        commands: [&Commands<'_>; W],
        held: &[Row<f64, W>],
        from: Row<f64, W>,
        to: Row<f64, W>,
        parts: usize,
    ) {
        let model = commands[0];
        self.mean.clear();
        self.slopes.clear();
        if model.filters.is_empty() {
            self.mean.extend_from_slice(held);
            return;
        }
        for _ in 0..parts {
            self.mean.extend_from_slice(held);
        }
        self.slopes
            .resize(parts * model.filters.len(), Row::splat(0.0));
        for lane in 0..W {
            for joint in Joint::all(model.joints) {
                if let Some(history) = &commands[lane].histories[joint] {
                    for (part, mean) in history.means(from[lane], to[lane], parts).enumerate() {
                        self.set(lane, joint, model, part, mean);
                    }
                }
            }
        }
    }

    /// Means over one part, one a joint, and the slopes there, one a filter.
    pub fn part(&self, joints: usize, part: usize) -> (&[Row<f64, W>], &[Row<f64, W>]) {
        let parts = self.mean.len() / joints;
        let filters = self.slopes.len() / parts;
        let part = part % parts;
        (
            &self.mean[part * joints..][..joints],
            &self.slopes[part * filters..][..filters],
        )
    }

    fn set(&mut self, lane: usize, joint: Joint, model: &Commands<'_>, part: usize, mean: Mean) {
        self.mean[part * model.joints + joint.index()][lane] = mean.value;
        for (k, filter) in model.filters.iter().enumerate() {
            if filter.joint == joint {
                self.slopes[part * model.filters.len() + k][lane] = match filter.kind {
                    CommandFilter::Delay => mean.by_delay,
                    CommandFilter::Lag => mean.by_lag,
                };
            }
        }
    }
}

/// One joint's command, delayed by `delay` and smoothed with the time constant `lag` (s), in closed form.
#[derive(Debug, Clone)]
struct History<'l> {
    delay: f64,
    lag: f64,
    time: &'l [f64],
    /// The command from each row on.
    command: &'l [f64],
    /// At each row: integral of the command from the first row on, output of the lag, its derivative by `lag`.
    integral: Vec<f64>,
    output: Vec<f64>,
    output_by_lag: Vec<f64>,
}

/// The filtered torque at one instant, seen from the left: what a delay above zero lets see.
#[derive(Debug, Clone, Copy)]
struct Instant {
    /// In s, less the delay.
    time: f64,
    output: f64,
    /// Integral of the output up to now, up to a constant.
    integral: f64,
    integral_by_lag: f64,
}

impl<'l> History<'l> {
    fn new(time: &'l [f64], command: &'l [f64], delay: f64, lag: f64) -> Self {
        let mut history = Self {
            delay,
            lag,
            time,
            command,
            integral: vec![0.0],
            output: vec![command[0]],
            output_by_lag: vec![0.0],
        };
        for row in 1..time.len() {
            let span = time[row] - time[row - 1];
            let (output, output_by_lag) = history.within(row - 1, span);
            let integral = history.integral[row - 1] + command[row - 1] * span;
            history.integral.push(integral);
            history.output.push(output);
            history.output_by_lag.push(output_by_lag);
        }
        history
    }

    /// Output of the lag, and its derivative by the time constant, `span` seconds after a row.
    fn within(&self, row: usize, span: f64) -> (f64, f64) {
        let (command, gap) = (self.command[row], self.output[row] - self.command[row]);
        // After 700 time constants the exponential is below every number, and without a lag at once.
        if span > 700.0 * self.lag {
            return (command, 0.0);
        }
        let decay = (-span / self.lag).exp();
        let steeper = gap * span / (self.lag * self.lag);
        (
            command + gap * decay,
            (self.output_by_lag[row] + steeper) * decay,
        )
    }

    fn at(&self, time: f64) -> Instant {
        let time = time - self.delay;
        let row = self.time.partition_point(|t| *t < time);
        let (output, output_by_lag, command_integral) = match row.checked_sub(1) {
            None => (
                self.command[0],
                0.0,
                self.command[0] * (time - self.time[0]),
            ),
            Some(row) => {
                let span = time - self.time[row];
                let (output, output_by_lag) = self.within(row, span);
                let integral = self.integral[row] + self.command[row] * span;
                (output, output_by_lag, integral)
            }
        };
        // T dx/dt + x = u, integrated once.
        Instant {
            time,
            output,
            integral: command_integral - self.lag * output,
            integral_by_lag: -output - self.lag * output_by_lag,
        }
    }

    fn mean(&self, from: f64, to: f64) -> Mean {
        self.at(from).mean_until(&self.at(to))
    }

    /// Means over equal parts. Neighbouring parts share the very same instant, so that a jump there counts once.
    #[allow(clippy::cast_precision_loss)] // few parts
    fn means(&self, from: f64, to: f64, parts: usize) -> impl Iterator<Item = Mean> {
        let length = (to - from) / parts as f64;
        let mut before = self.at(from);
        (1..=parts).map(move |part| {
            let end = if part == parts {
                to
            } else {
                from + length * part as f64
            };
            let now = self.at(end);
            let mean = before.mean_until(&now);
            before = now;
            mean
        })
    }
}

impl Instant {
    /// Zero over no time, in which nothing moves.
    fn mean_until(&self, end: &Self) -> Mean {
        let length = end.time - self.time;
        if length <= 0.0 {
            return Mean::default();
        }
        Mean {
            value: (end.integral - self.integral) / length,
            by_delay: (self.output - end.output) / length,
            by_lag: (end.integral_by_lag - self.integral_by_lag) / length,
        }
    }
}
