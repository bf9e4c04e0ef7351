//! Delays and lags between commanded and acting torque: linear filters of the command, independent of the state.

use std::borrow::Cow;
use std::ops::Range;

use super::{Hold, Point};
use crate::data::{Joint, Log, Measured, TorqueColumn};
use crate::lanes::Row;
use crate::model::{CommandFilter, Filter};

/// A history of commanded torques, filtered by the delays and lags of a model, and of what else the model reads from a log.
///
/// Each command is held until the next row; the first counts as held for ever before, the last for ever after. The
/// filters are linear, so the order of a delay and a lag on one joint does not matter.
#[derive(Debug, Clone)]
pub struct Commands<'l> {
    time: &'l [f64],
    /// The command of each joint, held from each row on.
    tau: Vec<Cow<'l, [f64]>>,
    /// The further measured columns that the model reads, in its order, held in the same way.
    measured: Vec<&'l [f64]>,
    joints: usize,
    /// The model's filters, in the order of [`StepTorque::slopes`].
    filters: Vec<Filter>,
    /// The filtered history of each joint, if the joint has a filter.
    histories: Vec<Option<History<'l>>>,
}

/// The torque that acts on a joint, averaged over some time.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Mean {
    /// In N m (or N).
    pub value: f64,
    /// Derivatives of the value with respect to the delay and the time constant, per s.
    by_delay: f64,
    by_lag: f64,
}

impl Mean {
    /// The derivative with respect to the parameter of a filter.
    pub fn slope(&self, kind: CommandFilter) -> f64 {
        match kind {
            CommandFilter::Delay => self.by_delay,
            CommandFilter::Lag => self.by_lag,
        }
    }
}

impl<'l> Commands<'l> {
    /// Filter the torques `tau` (`[joint][row]`), each held from `time[row]` (s) on.
    ///
    /// # Panics
    /// If the model reads further measured columns, which a log alone has: [`Commands::of_log`].
    pub fn new<'p>(model: impl Into<Point<'p>>, time: &'l [f64], tau: &'l [Vec<f64>]) -> Self {
        let model = model.into();
        let none = model.dynamics.measured.is_empty();
        assert!(none, "a model that reads measured columns follows logs");
        let tau = tau.iter().map(|tau| Cow::Borrowed(tau.as_slice()));
        Self::held_in(model, time, tau.collect(), Vec::new())
    }

    fn held_in(
        model: Point<'_>,
        time: &'l [f64],
        tau: Vec<Cow<'l, [f64]>>,
        measured: Vec<&'l [f64]>,
    ) -> Self {
        let (dynamics, values) = (model.dynamics, model.values());
        let history = |joint: Joint| {
            let own = |kind: CommandFilter| {
                let mut filters = dynamics.filters.iter();
                filters.find(|filter| filter.joint == joint && filter.kind == kind)
            };
            let (delay, lag) = (own(CommandFilter::Delay), own(CommandFilter::Lag));
            let value = |filter: Option<&Filter>| filter.map_or(0.0, |f| values[f.parameter]);
            (delay.is_some() || lag.is_some())
                .then(|| History::new(time, tau[joint.index()].clone(), value(delay), value(lag)))
        };
        Self {
            time,
            joints: dynamics.joints,
            filters: dynamics.filters.clone(),
            histories: Joint::all(dynamics.joints).map(history).collect(),
            tau,
            measured,
        }
    }

    /// Filter the torques of a log.
    ///
    /// # Panics
    /// If the log lacks a measured column that the model reads: [`Log::check_measured`] tells.
    pub fn of_log<'p>(model: impl Into<Point<'p>>, log: &'l Log) -> Self {
        Self::of_rows(model, log, 0..log.rows())
    }

    /// The same for some rows of a log, the first of which counts as held for ever before.
    ///
    /// # Panics
    /// As [`Commands::of_log`].
    pub fn of_rows<'p>(model: impl Into<Point<'p>>, log: &'l Log, rows: Range<usize>) -> Self {
        let model = model.into();
        let tau = (0..log.joints()).map(|joint| match log.held_torques(joint) {
            Cow::Borrowed(all) => Cow::Borrowed(&all[rows.clone()]),
            Cow::Owned(all) => Cow::Owned(all[rows.clone()].to_vec()),
        });
        let measured = Measured::named(&log.measured, model.dynamics.measured_names());
        let measured = measured.into_iter().map(|all| &all[rows.clone()]);
        let (tau, measured) = (tau.collect(), measured.collect());
        Self::held_in(model, &log.time[rows.clone()], tau, measured)
    }

    /// What the measured columns read from a time (s) on.
    fn measured_from(&self, time: f64) -> impl Iterator<Item = f64> {
        let after = || self.time.partition_point(|row| *row <= time);
        let row = match self.measured.is_empty() {
            true => 0,
            false => after().saturating_sub(1),
        };
        self.measured.iter().map(move |column| column[row])
    }

    /// The time (s) of one row per lane.
    pub(super) fn times<const W: usize>(commands: [&Self; W], rows: [usize; W]) -> Row<f64, W> {
        Row::from_fn(|lane| commands[lane].time[rows[lane]])
    }

    /// The commanded torques (`[joint][lane]`) held from one row per lane on.
    pub(super) fn held<const W: usize>(commands: [&Self; W], rows: [usize; W]) -> Vec<Row<f64, W>> {
        let held = |joint: usize, lane: usize| commands[lane].tau[joint][rows[lane]];
        Row::table(commands[0].joints, held)
    }

    /// The torque (`[joint][lane]`) that acted just before one row per lane, and after all joints what the measured columns
    /// read.
    pub fn just_before<const W: usize>(commands: [&Self; W], rows: [usize; W]) -> Vec<Row<f64, W>> {
        let of_lane = |joint: usize, lane: usize| {
            let (own, row) = (commands[lane], rows[lane]);
            match &own.histories[joint] {
                Some(history) => history.at(own.time[row]).output,
                None => own.tau[joint][row.saturating_sub(1)],
            }
        };
        let read = |column: usize, lane: usize| {
            commands[lane].measured[column][rows[lane].saturating_sub(1)]
        };
        let mut given = Row::table(commands[0].joints, of_lane);
        given.extend(Row::table(commands[0].measured.len(), read));
        given
    }

    /// Number of torques and measured columns.
    fn channels(&self) -> usize {
        self.joints + self.measured.len()
    }

    /// The log with commanded torques replaced by the mean acting torque from each row to the next.
    #[must_use]
    pub fn acting_on(&self, log: &Log) -> Log {
        Log {
            tau: self.acting(),
            torque: TorqueColumn::Held,
            ..log.clone()
        }
    }

    /// The mean acting torque from each row to the next, `[joint][row]`.
    pub fn acting(&self) -> Vec<Vec<f64>> {
        let of_joint = |(joint, commanded): (Joint, &Cow<'_, [f64]>)| match self.delivered(joint) {
            Some(means) => means.iter().map(|mean| mean.value).collect(),
            None => commanded.to_vec(),
        };
        let all = Joint::all(self.joints).zip(&self.tau);
        all.map(of_joint).collect()
    }

    /// What the drive of a joint delivers from each row to the next, if it has a filter.
    pub fn delivered(&self, joint: Joint) -> Option<Vec<Mean>> {
        let history = self.histories[joint].as_ref()?;
        let ends = history.at_rows();
        let means = ends.windows(2).map(|ends| ends[0].mean_until(&ends[1]));
        // The last command is held for ever.
        let last = Mean {
            value: *self.tau[joint.index()].last()?,
            ..Mean::default()
        };
        Some(means.chain([last]).collect())
    }
}

/// What is given over a hold, per substep: the torques that act, and the measured columns.
#[derive(Debug, Clone, Default)]
pub struct StepTorque<const W: usize> {
    /// `[substep * channels + channel][lane]`: mean torque of each joint in N m (or N), then the measured columns that the
    /// model reads. Without filters one part stands for all substeps.
    pub given: Vec<Row<f64, W>>,
    /// `[substep * filters + filter][lane]`: derivative of the mean on the filter's joint with respect to its
    /// parameter.
    pub slopes: Vec<Row<f64, W>>,
}

impl<const W: usize> StepTorque<W> {
    /// What is given over a hold.
    ///
    /// With means over substeps the integration is accurate to second order in the substep wherever the torque jumps,
    /// and its result is smooth in the filters' parameters.
    pub fn new(hold: &Hold<'_, W>) -> Self {
        let mut torque = Self::default();
        torque.fill(hold);
        torque
    }

    /// As [`StepTorque::new`], reusing the memory.
    pub fn fill(&mut self, hold: &Hold<'_, W>) {
        self.given.clear();
        self.slopes.clear();
        let filters = hold.commands[0].filters.len();
        let parts = if filters == 0 { 1 } else { hold.substeps };
        let channels = hold.held.len() + hold.commands[0].measured.len();
        self.slopes.resize(parts * filters, Row::splat(0.0));
        for part in 0..parts {
            self.given.extend_from_slice(hold.held);
            self.given.resize((part + 1) * channels, Row::splat(0.0));
        }
        for (lane, commands) in hold.commands.iter().enumerate() {
            self.filter(lane, commands, hold);
            self.read(lane, commands, hold);
        }
        for given in self.given.chunks_exact_mut(channels) {
            for (tau, force) in given.iter_mut().zip(hold.force) {
                for lane in 0..W {
                    tau[lane] += force[lane];
                }
            }
        }
    }

    /// Write the measured columns of one lane.
    fn read(&mut self, lane: usize, commands: &Commands<'_>, hold: &Hold<'_, W>) {
        let channels = commands.channels();
        for (column, value) in commands.measured_from(hold.from[lane]).enumerate() {
            let of_all_parts = self.given[commands.joints + column..].iter_mut();
            of_all_parts
                .step_by(channels)
                .for_each(|given| given[lane] = value);
        }
    }

    /// Write the filtered torques of one lane.
    fn filter(&mut self, lane: usize, commands: &Commands<'_>, hold: &Hold<'_, W>) {
        let (from, to) = (hold.from[lane], hold.to[lane]);
        for (joint, history) in Joint::all(commands.joints).zip(&commands.histories) {
            let Some(history) = history else { continue };
            for (part, mean) in history.means(from, to, hold.substeps).enumerate() {
                self.given[part * commands.channels() + joint.index()][lane] = mean.value;
                let slopes = self.slopes[part * commands.filters.len()..].iter_mut();
                for (slope, filter) in slopes.zip(&commands.filters) {
                    if filter.joint == joint {
                        slope[lane] = mean.slope(filter.kind);
                    }
                }
            }
        }
    }

    /// What was given over the last substep, in this many channels, or 0 before the first hold.
    pub(super) fn at_end(&self, channels: usize) -> Vec<Row<f64, W>> {
        match self.given.len().checked_sub(channels) {
            Some(last) => self.given[last..].to_vec(),
            None => vec![Row::splat(0.0); channels],
        }
    }

    /// What is given over one substep, in this many channels, and the slopes of the torques per filter.
    pub fn part(&self, channels: usize, part: usize) -> (&[Row<f64, W>], &[Row<f64, W>]) {
        let parts = self.given.len() / channels;
        let filters = self.slopes.len() / parts;
        let part = part % parts;
        (
            &self.given[part * channels..][..channels],
            &self.slopes[part * filters..][..filters],
        )
    }
}

/// The command of one joint, delayed by `delay` and lagged with the time constant `lag` (s), in closed form.
#[derive(Debug, Clone)]
struct History<'l> {
    delay: f64,
    lag: f64,
    time: &'l [f64],
    /// The command held from each row on.
    command: Cow<'l, [f64]>,
    /// At each row: integral of the command since the first row, output of the lag, derivative of the output with
    /// respect to `lag`.
    integral: Vec<f64>,
    output: Vec<f64>,
    output_by_lag: Vec<f64>,
}

/// The filtered torque just before an instant.
#[derive(Debug, Clone, Copy)]
struct Instant {
    /// The instant less the delay, in s since the first row.
    time: f64,
    output: f64,
    /// Integral of the output up to the instant, plus an arbitrary constant.
    integral: f64,
    integral_by_lag: f64,
}

impl<'l> History<'l> {
    fn new(time: &'l [f64], command: Cow<'l, [f64]>, delay: f64, lag: f64) -> Self {
        let starting = |value: f64| {
            let mut all = Vec::with_capacity(time.len());
            all.push(value);
            all
        };
        let mut history = Self {
            delay,
            lag,
            time,
            integral: starting(0.0),
            output: starting(command[0]),
            output_by_lag: starting(0.0),
            command,
        };
        for row in 1..time.len() {
            let span = time[row] - time[row - 1];
            let (output, output_by_lag) = history.within(row - 1, span);
            let integral = history.integral[row - 1] + history.command[row - 1] * span;
            history.integral.push(integral);
            history.output.push(output);
            history.output_by_lag.push(output_by_lag);
        }
        history
    }

    /// Output of the lag and its derivative with respect to the time constant, `span` seconds after a row.
    fn within(&self, row: usize, span: f64) -> (f64, f64) {
        let (command, gap) = (self.command[row], self.output[row] - self.command[row]);
        // After 700 time constants the exponential underflows. This also covers a time constant of zero.
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
        let since = time - self.time[0];
        self.instant(since - self.delay, self.next(since))
    }

    /// The instant just before each row: a walk, since the commands that act there come in order.
    fn at_rows(&self) -> Vec<Instant> {
        let mut next = 0;
        let rows = (0..self.time.len()).map(|row| {
            let time = self.since(row) - self.delay;
            next = self.walked(next, time);
            self.instant(time, next)
        });
        rows.collect()
    }

    /// The first row whose command has not acted `since` seconds after the first row. Rows are nearly evenly spaced, so the
    /// search begins where it would end if they were.
    #[allow(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss
    )]
    fn next(&self, since: f64) -> usize {
        let (time, rows) = (since - self.delay, self.time.len());
        let has_acted = |row: usize| self.since(row) < time;
        let share = time / self.since(rows - 1);
        let [mut low, mut high] = [((share * rows as f64) as usize).min(rows); 2];
        let mut stride = 1;
        while high < rows && has_acted(high) {
            (low, high, stride) = (high + 1, (high + stride).min(rows), 2 * stride);
        }
        while low > 0 && !has_acted(low - 1) {
            (low, high, stride) = (low.saturating_sub(stride), low - 1, 2 * stride);
        }
        low + self.time[low..high].partition_point(|t| *t - self.time[0] < time)
    }

    /// The same from a row on, for times in ascending order less the delay.
    fn walked(&self, from: usize, time: f64) -> usize {
        let later = from..self.time.len();
        let mut not_acted = later.filter(|row| self.since(*row) >= time);
        not_acted.next().unwrap_or(self.time.len())
    }

    /// The time of a row since the first. Time differences keep the digits that large times lose.
    fn since(&self, row: usize) -> f64 {
        self.time[row] - self.time[0]
    }

    /// The instant at which the commands of a time since the first row act, before those of the `next` row.
    fn instant(&self, time: f64, next: usize) -> Instant {
        let (output, output_by_lag, command_integral) = match next.checked_sub(1) {
            None => (self.command[0], 0.0, self.command[0] * time),
            Some(row) => {
                let span = time - self.since(row);
                let (output, output_by_lag) = self.within(row, span);
                let integral = self.integral[row] + self.command[row] * span;
                (output, output_by_lag, integral)
            }
        };
        // From the integral of T dx/dt + x = u.
        Instant {
            time,
            output,
            integral: command_integral - self.lag * output,
            integral_by_lag: -output - self.lag * output_by_lag,
        }
    }

    /// Means over equal substeps. Neighbouring substeps share the same instant, so a jump at it counts once.
    #[allow(clippy::cast_precision_loss)] // few parts
    fn means(&self, from: f64, to: f64, parts: usize) -> impl Iterator<Item = Mean> {
        let length = (to - from) / parts as f64;
        let [from, to] = [from, to].map(|time| time - self.time[0]);
        let mut next = self.next(from);
        let mut before = self.instant(from - self.delay, next);
        (1..=parts).map(move |part| {
            let end = if part == parts {
                to
            } else {
                from + length * part as f64
            };
            let time = end - self.delay;
            next = self.walked(next, time);
            let now = self.instant(time, next);
            let mean = before.mean_until(&now);
            before = now;
            mean
        })
    }
}

impl Instant {
    /// The mean over the time until `end`, or zero if no time passes.
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

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use super::History;

    #[test]
    fn the_next_command_is_found_however_the_rows_are_spaced() {
        let even: Vec<f64> = (0..50).map(|row| 7.0 + 0.01 * f64::from(row)).collect();
        let bent: Vec<f64> = (0..50).map(|row| 7.0 + f64::from(row).powi(4)).collect();
        for time in [vec![7.0], even, bent] {
            let span = time[time.len() - 1] - time[0];
            let command = Cow::Owned(vec![0.0; time.len()]);
            let history = History::new(&time, command, 0.25 * span, 0.0);
            for part in -2..=60 {
                let since = f64::from(part) * 0.02 * span;
                let mut rows = 0..time.len();
                let next = rows.find(|row| history.since(*row) >= since - history.delay);
                assert_eq!(history.next(since), next.unwrap_or(time.len()), "{since}");
            }
        }
    }
}
