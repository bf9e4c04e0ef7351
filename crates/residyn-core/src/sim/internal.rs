//! The internal states of a model along the motion of a log: its effects' memory of what came before.
//!
//! Where a motion is measured, the states of effects do not depend on how well the model predicts it. They are integrated
//! along the log, once for each set of parameters, and then stand beside the measured columns.

use std::ops::Range;
use std::sync::Arc;

use super::scheme::{HEUN, Scheme};
use super::{Commands, Point};
use crate::data::{Log, Measured, half_width_s, local_cubic};
use crate::expr::{Graph, Node, Program, Tape};
use crate::lanes::Row;
use crate::model::{Dependence, Dynamics, Filter, InputLayout, InternalStates};

/// The most logs that are walked along side by side.
const LANES: usize = 8;
/// Rows nearer together than this, s, are taken as one step: what dry friction remembers depends on the way alone, and
/// states that decay are accurate to second order in the step.
const STEP_S: f64 = 4e-3;
const SCHEME: &Scheme = HEUN;
/// Steps in which states come to rest, so long that each is one of Newton's.
const SETTLING: usize = 4;
const SETTLING_S: f64 = 1e3;

/// The angles of a log (`[joint][row of the grid]`, rad or m), each smoothed by the rows of the log around it.
#[derive(Debug, Clone)]
pub struct LoggedMotion {
    q: Vec<Vec<f64>>,
    grid: Arc<Grid>,
}

/// The rows of a log between which steps are taken.
#[derive(Debug, Default)]
struct Grid {
    /// Of all rows of the log, s.
    time: Vec<f64>,
    rows: Vec<usize>,
}

impl LoggedMotion {
    pub fn of(log: &Log) -> Self {
        let mut rows = vec![0];
        for row in 1..log.rows() {
            let last = rows[rows.len() - 1];
            // Logged times are rounded decimals.
            if log.time[row] - log.time[last] > 0.99 * STEP_S || row + 1 == log.rows() {
                rows.push(row);
            }
        }
        let half_width = half_width_s(log.median_step());
        let smoothed = |q: &Vec<f64>| {
            let at = |row: &usize| {
                let found = local_cubic(&log.time, q, *row, half_width);
                found.map_or(q[*row], |found| found.value)
            };
            rows.iter().map(at).collect()
        };
        Self {
            q: log.q.iter().map(smoothed).collect(),
            grid: Arc::new(Grid {
                time: log.time.clone(),
                rows,
            }),
        }
    }
}

impl Grid {
    /// A channel that is given at the rows of the grid, at these rows of the log.
    fn between(&self, channel: &[f64], rows: Range<usize>) -> Vec<f64> {
        let after = self.rows.partition_point(|row| *row <= rows.start);
        let mut next = after.min(self.rows.len() - 1).max(1);
        let at = |row: usize| {
            while next + 1 < self.rows.len() && self.rows[next] < row {
                next += 1;
            }
            let Some(end) = self.rows.get(next) else {
                return channel[0];
            };
            let [from, to] = [self.time[self.rows[next - 1]], self.time[*end]];
            let share = (self.time[row] - from) / (to - from);
            channel[next - 1] + share * (channel[next] - channel[next - 1])
        };
        rows.map(at).collect()
    }
}

/// The rates of a model's internal states and, if asked for, of their slopes by parameters.
///
/// Inputs of the program: those of the model's program. Outputs: the rates, then the factors of the `terms`.
#[derive(Debug, Clone)]
pub struct InternalRates {
    program: Program,
    layout: InputLayout,
    internal: InternalStates,
    /// What there are slopes of.
    pairs: Vec<Dependence>,
    /// For each of the pairs the terms that make up the rate of its slope.
    terms: Vec<Vec<Term>>,
    /// The slopes of the starts, in the order of the pairs, from the model's parameters.
    start_slopes: Program,
    filters: Vec<Filter>,
    /// For each input whether a rate depends on it.
    reads: Vec<bool>,
}

/// A part of the rate of a slope: an output of the program times something.
#[derive(Debug, Clone, Copy)]
struct Term {
    factor: usize,
    times: Times,
}

#[derive(Debug, Clone, Copy)]
enum Times {
    One,
    /// The slope of a pair, now or at the start of the step.
    Now(usize),
    Start(usize),
    /// The slope of the torque of a filter.
    Filter(usize),
}

impl InternalRates {
    /// The rates alone; `None` for a model without internal states.
    pub fn plain(dynamics: &Dynamics) -> Option<Self> {
        let internal = dynamics.internal.as_ref()?;
        Some(Self {
            program: internal.rates.clone(),
            reads: internal.rates.inputs_read(),
            layout: dynamics.layout(),
            internal: internal.clone(),
            pairs: Vec::new(),
            terms: Vec::new(),
            start_slopes: Graph::new().finish(&[]),
            filters: dynamics.filters.clone(),
        })
    }

    /// With the slopes of [`InternalStates::pairs`] by these parameters.
    pub fn with_slopes(dynamics: &Dynamics, active: &[usize]) -> Option<Self> {
        let mut plain = Self::plain(dynamics)?;
        let pairs = plain.internal.pairs.iter().copied();
        plain.pairs = pairs
            .filter(|pair| active.contains(&pair.parameter))
            .collect();
        let (program, terms) = plain.differentiated();
        Some(Self {
            start_slopes: plain.start_slopes_of_pairs(),
            program,
            terms,
            ..plain
        })
    }

    /// The program with the factors of all terms, and the terms.
    fn differentiated(&self) -> (Program, Vec<Vec<Term>>) {
        let (layout, internal) = (self.layout, &self.internal);
        let mut graph = Graph::new();
        let names = internal.rates.inputs().iter();
        let inputs: Vec<Node> = names.map(|name| graph.input(name)).collect();
        let rates = graph.append(&internal.rates, &inputs);
        let mut outputs = rates.clone();
        let mut of_pair = |pair: &Dependence| {
            let slope_of = |other: usize| {
                let is_it =
                    |own: &Dependence| own.state == other && own.parameter == pair.parameter;
                self.pairs.iter().position(is_it)
            };
            let mut wrt = vec![(inputs[layout.parameters() + pair.parameter], Times::One)];
            for other in 0..rates.len() {
                let Some(slope) = slope_of(other) else {
                    continue;
                };
                let [now, start] = [layout.internal(), layout.starts()].map(|of| of.start + other);
                wrt.push((inputs[now], Times::Now(slope)));
                wrt.push((inputs[start], Times::Start(slope)));
            }
            for (k, filter) in self.filters.iter().enumerate() {
                if filter.parameter == pair.parameter {
                    wrt.push((inputs[layout.driving_of(filter.joint)], Times::Filter(k)));
                }
            }
            let nodes: Vec<Node> = wrt.iter().map(|(node, _)| *node).collect();
            let slopes = graph.jacobian(&[rates[pair.state]], &nodes).concat();
            let mut terms = Vec::new();
            for (slope, (_, times)) in slopes.into_iter().zip(wrt) {
                if !graph.is_zero(slope) {
                    terms.push(Term {
                        factor: outputs.len(),
                        times,
                    });
                    outputs.push(slope);
                }
            }
            terms
        };
        let terms = self.pairs.iter().map(&mut of_pair).collect();
        (graph.finish(&outputs), terms)
    }

    fn start_slopes_of_pairs(&self) -> Program {
        let mut graph = Graph::new();
        let names = self.internal.starts.inputs().iter();
        let inputs: Vec<Node> = names.map(|name| graph.input(name)).collect();
        let starts = graph.append(&self.internal.starts, &inputs);
        let one = graph.constant(1.0);
        let slope = |pair: &Dependence| {
            graph.gradient(&[starts[pair.state]], &[one], &[inputs[pair.parameter]])[0]
        };
        let slopes: Vec<Node> = self.pairs.iter().map(slope).collect();
        graph.finish(&slopes)
    }

    /// What there are slopes of.
    pub fn pairs(&self) -> &[Dependence] {
        &self.pairs
    }

    /// The internal states along some logs, each with the model's values in that log.
    pub fn along(&self, cases: &[Case<'_>]) -> Vec<Course> {
        let packs = cases.chunks(LANES);
        let of_pack = |pack: &[Case<'_>]| match pack.len() {
            1 => self.along_some::<1>(pack),
            2 => self.along_some::<2>(pack),
            3 | 4 => self.along_some::<4>(pack),
            _ => self.along_some::<LANES>(pack),
        };
        packs.flat_map(of_pack).collect()
    }

    fn reads_torques(&self) -> bool {
        self.reads[self.layout.driving()].contains(&true)
    }
}

/// A log with the model's values in it and its filtered commands.
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    pub log: &'a Log,
    pub point: &'a Point<'a>,
    pub motion: &'a LoggedMotion,
    pub commands: &'a Commands<'a>,
}

/// The internal states along a log, and their derivatives with respect to parameters in the order of
/// [`InternalRates::pairs`], if asked for.
#[derive(Debug, Clone, Default)]
pub struct Course {
    grid: Arc<Grid>,
    /// `[channel][row of the grid]`: the states, then the derivatives.
    channels: Vec<Vec<f64>>,
    states: usize,
}

impl Course {
    /// The states at these rows of the log, `[state][row]`.
    pub fn states(&self, rows: Range<usize>) -> Vec<Vec<f64>> {
        self.between(0..self.states, rows)
    }

    /// The derivatives at these rows of the log, `[pair][row]`.
    pub fn slopes(&self, rows: Range<usize>) -> Vec<Vec<f64>> {
        self.between(self.states..self.channels.len(), rows)
    }

    fn between(&self, channels: Range<usize>, rows: Range<usize>) -> Vec<Vec<f64>> {
        let channels = self.channels[channels].iter();
        channels
            .map(|channel| self.grid.between(channel, rows.clone()))
            .collect()
    }
}

/// The internal states of a model along one log, `[state][row]`; empty for a model without any.
pub fn internal_along(point: &Point<'_>, log: &Log, commands: &Commands<'_>) -> Vec<Vec<f64>> {
    let Some(rates) = InternalRates::plain(point.dynamics) else {
        return Vec::new();
    };
    let motion = &LoggedMotion::of(log);
    let case = Case {
        log,
        point,
        motion,
        commands,
    };
    let mut courses = rates.along(&[case]);
    let course = courses.pop();
    course.map_or_else(Vec::new, |course| course.states(0..log.rows()))
}

/// Internal states at the start of a motion, `[lane]`, with their slopes by parameters.
#[derive(Debug, Clone)]
pub struct InternalStart<const W: usize> {
    pub values: Vec<Row<f64, W>>,
    pub slopes: Vec<(Dependence, Row<f64, W>)>,
}

/// None.
impl<const W: usize> Default for InternalStart<W> {
    fn default() -> Self {
        Self {
            values: Vec::new(),
            slopes: Vec::new(),
        }
    }
}

impl<const W: usize> InternalStart<W> {
    /// Those at a row of each lane's course, with the slopes of these pairs.
    pub fn of(lanes: [(&Course, usize); W], pairs: &[Dependence]) -> Self {
        let of_lane = |(course, row): (&Course, usize)| {
            let all = course.between(0..course.states + pairs.len(), row..row + 1);
            all.concat()
        };
        let all = lanes.map(of_lane);
        let at = |channel: usize| Row::from_fn(|lane| all[lane][channel]);
        let states = lanes[0].0.states;
        let slopes = pairs.iter().zip(states..);
        Self {
            values: (0..states).map(at).collect(),
            slopes: slopes.map(|(pair, channel)| (*pair, at(channel))).collect(),
        }
    }
}

/// What a log gives over its steps.
struct Track {
    /// `[row of the grid]`
    time: Vec<f64>,
    q: Vec<Vec<f64>>,
    /// `[channel][step]`: mean torques that act, then measured columns.
    given: Vec<Vec<f64>>,
    /// `[filter][step]`
    slopes: Vec<Vec<f64>>,
}

impl InternalRates {
    fn track(&self, case: &Case<'_>) -> Track {
        let LoggedMotion { q, grid } = case.motion;
        let Grid { time, rows: grid } = &**grid;
        let mean = |channel: &Vec<f64>| -> Vec<f64> {
            let steps = grid.windows(2).map(|ends| &channel[ends[0]..ends[1]]);
            steps
                .map(|rows| rows.iter().sum::<f64>() / rows.len() as f64)
                .collect()
        };
        let torques = match self.reads_torques() {
            true => case.commands.acting().iter().map(mean).collect(),
            false => vec![vec![0.0; grid.len() - 1]; self.layout.driving().len()],
        };
        let measured = Measured::named(&case.log.measured, case.point.dynamics.measured_names());
        let slope = |filter: &Filter| {
            let means = case.commands.delivered(filter.joint).unwrap_or_default();
            mean(&means.iter().map(|mean| mean.slope(filter.kind)).collect())
        };
        let filters = match self.reads_torques() && !self.terms.is_empty() {
            true => self.filters.as_slice(),
            false => &[],
        };
        let measured = measured.into_iter().map(mean);
        Track {
            time: grid.iter().map(|row| time[*row]).collect(),
            q: q.clone(),
            given: [torques, measured.collect()].concat(),
            slopes: filters.iter().map(slope).collect(),
        }
    }

    /// The states along as many logs as there are lanes, or fewer.
    fn along_some<const W: usize>(&self, cases: &[Case<'_>]) -> Vec<Course> {
        let tracks: Vec<Track> = cases.iter().map(|case| self.track(case)).collect();
        let mut walk = Walk::<W>::new(self, cases);
        walk.settle(&tracks);
        let first = |lane: usize| walk.now.iter().map(move |now| vec![now[lane]]).collect();
        let mut courses: Vec<Vec<Vec<f64>>> = (0..cases.len()).map(first).collect();
        let steps = tracks.iter().map(Track::steps).max().unwrap_or(0);
        for step in 0..steps {
            walk.step(&tracks, step);
            for (lane, course) in courses.iter_mut().enumerate() {
                if step < tracks[lane].steps() {
                    let channels = course.iter_mut().zip(&walk.now);
                    channels.for_each(|(channel, now)| channel.push(now[lane]));
                }
            }
        }
        let each = courses.into_iter().zip(cases);
        each.map(|(channels, case)| Course {
            grid: Arc::clone(&case.motion.grid),
            channels,
            states: self.internal.names.len(),
        })
        .collect()
    }
}

impl Track {
    fn steps(&self) -> usize {
        self.time.len() - 1
    }
}

/// Steps along logs, one in each lane.
struct Walk<'r, const W: usize> {
    rates: &'r InternalRates,
    tape: Tape<f64, W>,
    /// The states, then their slopes: now, in a stage, and after a step; and the rates of all of them.
    now: Vec<Row<f64, W>>,
    inner: Vec<Row<f64, W>>,
    next: Vec<Row<f64, W>>,
    slopes: Vec<Row<f64, W>>,
    /// The mean slopes of the torques of filters over a step.
    filters: Vec<Row<f64, W>>,
}

impl<'r, const W: usize> Walk<'r, W> {
    /// Before the first row of each log.
    fn new(rates: &'r InternalRates, cases: &[Case<'_>]) -> Self {
        let first = rates.layout.parameters();
        let mut tape = rates.program.tape_at(first, cases[0].point.values());
        let at = |lane: usize| cases[lane.min(cases.len() - 1)].point.values();
        for (k, input) in tape.inputs()[first..].iter_mut().enumerate() {
            *input = Row::from_fn(|lane| at(lane)[k]);
        }
        let starts = |lane: usize| {
            let values = rates.internal.starts.eval(at(lane));
            let slopes = match rates.terms.is_empty() {
                true => Vec::new(),
                false => rates.start_slopes.eval(at(lane)),
            };
            [values, slopes].concat()
        };
        let starts: Vec<Vec<f64>> = (0..W).map(starts).collect();
        let now = Row::table(starts[0].len(), |k, lane| starts[lane][k]);
        Self {
            rates,
            tape,
            inner: now.clone(),
            next: now.clone(),
            slopes: now.clone(),
            now,
            filters: Vec::new(),
        }
    }

    /// Bring the states that rest under what acts at the first row to rest there, with their slopes.
    fn settle(&mut self, tracks: &[Track]) {
        let internal = &self.rates.internal;
        if !internal.settled.contains(&true) || tracks.iter().any(|track| track.steps() == 0) {
            return;
        }
        let of_pairs = self
            .rates
            .pairs
            .iter()
            .map(|pair| internal.settled[pair.state]);
        let settled: Vec<bool> = internal.settled.iter().copied().chain(of_pairs).collect();
        for _ in 0..SETTLING {
            self.move_on(tracks, 0, Some(SETTLING_S));
            let each = self.now.iter_mut().zip(&self.next).zip(&settled);
            each.filter(|(_, settled)| **settled)
                .for_each(|((now, next), _)| *now = *next);
        }
    }

    /// Move along one step of each log; lanes whose log has ended stay where they are.
    fn step(&mut self, tracks: &[Track], step: usize) {
        self.move_on(tracks, step, None);
        std::mem::swap(&mut self.now, &mut self.next);
    }

    /// Work out what is next, after one step of each log or after a step of another length under the same inputs.
    fn move_on(&mut self, tracks: &[Track], step: usize, length_s: Option<f64>) {
        let layout = self.rates.layout;
        let track = |lane: usize| tracks.get(lane).filter(|track| step < track.steps());
        let read = |of: &dyn Fn(&Track) -> f64| Row::from_fn(|lane| track(lane).map_or(0.0, of));
        let between = read(&|track| track.time[step + 1] - track.time[step]);
        let h = length_s.map_or(between, Row::splat);
        let states = self.rates.internal.names.len();
        let filters = 0..tracks[0].slopes.len();
        self.filters.clear();
        (self.filters).extend(filters.map(|k| read(&|track| track.slopes[k][step])));
        let inputs = self.tape.moving();
        let reads = &self.rates.reads;
        for (k, place) in layout
            .given()
            .enumerate()
            .filter(|(_, place)| reads[*place])
        {
            inputs[place] = read(&|track| track.given[k][step]);
        }
        for (joint, place) in layout
            .velocities()
            .enumerate()
            .filter(|(_, place)| reads[*place])
        {
            inputs[place] = read(&|track| {
                let q = &track.q[joint];
                (q[step + 1] - q[step]) / (track.time[step + 1] - track.time[step])
            });
        }
        inputs[layout.starts()].copy_from_slice(&self.now[..states]);
        inputs[layout.step()] = h;
        self.next.copy_from_slice(&self.now);
        self.inner.copy_from_slice(&self.now);
        for stage in SCHEME.stages {
            let inputs = self.tape.moving();
            for joint in layout.positions().filter(|joint| reads[*joint]) {
                inputs[joint] = read(&|track| {
                    let q = &track.q[joint];
                    q[step] + stage.time * (q[step + 1] - q[step])
                });
            }
            let time = |track: &Track| track.time[step];
            inputs[layout.time()] = read(&time);
            for lane in 0..W {
                inputs[layout.time()][lane] += stage.time * between[lane];
            }
            inputs[layout.internal()].copy_from_slice(&self.inner[..states]);
            self.tape.run();
            for k in 0..self.slopes.len() {
                self.slopes[k] = self.slope(k);
            }
            for (k, slope) in self.slopes.iter().enumerate() {
                for lane in 0..W {
                    self.next[k][lane] += stage.weight * h[lane] * slope[lane];
                    self.inner[k][lane] = self.now[k][lane] + stage.reach * h[lane] * slope[lane];
                }
            }
        }
    }

    /// The rate of a state, or of a slope of one, in a stage for which the tape has run.
    fn slope(&self, k: usize) -> Row<f64, W> {
        let states = self.rates.internal.names.len();
        if k < states {
            return *self.tape.output(k);
        }
        let one = Row::splat(1.0);
        let mut rate = Row::splat(0.0);
        for Term { factor, times } in &self.rates.terms[k - states] {
            let factor = self.tape.output(*factor);
            let times = match *times {
                Times::One => &one,
                Times::Now(pair) => &self.inner[states + pair],
                Times::Start(pair) => &self.now[states + pair],
                Times::Filter(filter) => &self.filters[filter],
            };
            (0..W).for_each(|lane| rate[lane] += factor[lane] * times[lane]);
        }
        rate
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::internal_along;
    use crate::data::{Joint, Log};
    use crate::model::{Dynamics, FittedEffect, Library};
    use crate::sim::{Commands, Point, with_own_angles};

    const BRISTLES: &str = r#"
        [effect]
        name = "bristles"
        about = "friction that gives before it slips, grows with the load and falls as it warms up"
        force = "-k*z*(1 - a*w)"
        [states]
        z = { rate = "qd - abs(qd)*k*z/(F + c*abs(load))", unit = "rad" }
        w = { rate = "(k*z*qd - w)/T", unit = "1", start = "w_0", within = ["-0.02", "0.05"] }
        [parameters]
        k = { unit = "N m/rad", typical = 30 }
        F = { unit = "N m", typical = 0.5 }
        c = { unit = "1", typical = 0.2 }
        a = { unit = "1", typical = 0.3 }
        T = { unit = "s", typical = 0.2 }
        w_0 = { unit = "1", typical = 0.01 }
    "#;

    /// An effect with two states that depend on each other, on the load and on parameters, at its typical values.
    pub(crate) fn bristles(joint: Joint) -> FittedEffect {
        FittedEffect::typical(&BRISTLES.parse().unwrap(), joint)
    }

    /// A pendulum with an effect of one state, in these lines.
    fn pendulum(state: &str, parameters: &str) -> Dynamics {
        let effect = format!(
            "[effect]\nname = \"own\"\nabout = \"\"\nforce = \"x\"\n[states]\nx = {{ {state} }}\n\
             [parameters]\n{parameters}\n"
        );
        let effect = FittedEffect::absent(&effect.parse().unwrap(), Joint::at(0));
        let pendulum = Library::built_in().model("pendulum").unwrap();
        pendulum.with_effects(vec![effect]).dynamics()
    }

    /// A log of this angle at a row every `step_s`.
    fn log(angle: impl Fn(f64) -> f64, step_s: f64) -> Log {
        let mut log = Log::empty(1);
        log.time = (0..400).map(|row| step_s * f64::from(row)).collect();
        log.q = vec![log.time.iter().map(|t| angle(*t)).collect()];
        log.qd = vec![vec![0.0; 400]];
        log.tau = vec![vec![0.0; 400]];
        log
    }

    fn along(model: &Dynamics, values: &[f64], log: &Log) -> Vec<f64> {
        let point = Point::new(model, [&model.values()[..2], values].concat());
        let commands = Commands::of_log(&point, log);
        internal_along(&point, log, &commands).remove(0)
    }

    /// Back and forth over 2 rad with an end of travel of 0.3 rad: the state follows the way, and stays at the ends.
    #[test]
    fn a_state_within_ends_remembers_the_way_alone() {
        let state = "rate = \"qd\", unit = \"rad\", within = [\"-e\", \"e\"]";
        let model = pendulum(state, "e = { unit = \"rad\", typical = 1 }");
        let way = |t: f64| 1.0 - (3.0 * t).cos();
        for step_s in [0.001, 0.004, 0.01] {
            let log = log(way, step_s);
            let found = along(&model, &[0.3], &log);
            let mut wanted = 0.0_f64;
            for row in 1..log.rows() {
                wanted = (wanted + log.q[0][row] - log.q[0][row - 1]).clamp(-0.3, 0.3);
                assert!(
                    (found[row] - wanted).abs() < 2e-3,
                    "{step_s}, row {row}: {} {wanted}",
                    found[row]
                );
            }
        }
    }

    /// A play between joint and sensor, which reads the joint's angle off by half of it.
    #[test]
    fn angles_of_a_model_with_states_are_read_through_its_sensors() {
        let play = Library::built_in().effect("backlash").unwrap().clone();
        let mut play = FittedEffect::absent(&play, Joint::at(0));
        play.values[0].0 = 0.02;
        let pendulum = Library::built_in().model("pendulum").unwrap();
        let model = pendulum.with_effects(vec![bristles(Joint::at(0)), play]);
        let mut log = log(|t| t, 0.005);
        // Reported at the ends, where no cubic is fitted.
        log.qd[0].fill(1.0);
        let own = with_own_angles(&model.dynamics(), &log);
        for (read, own) in log.q[0].iter().zip(&own.q[0]) {
            assert!((own - read - 0.01).abs() < 1e-6, "{read} {own}");
        }
    }

    /// A state that follows the angle with time constants from far above the step to far below it.
    #[test]
    fn a_state_that_decays_is_stable_and_accurate_at_any_step() {
        let state = "rate = \"(q - x)/T\", unit = \"rad\", start = \"x_0\"";
        let parameters = "T = { unit = \"s\", typical = 1 }\nx_0 = { unit = \"rad\", typical = 1 }";
        let model = pendulum(state, parameters);
        let log = log(|t| t, 0.005);
        for time in [1.0, 0.1, 0.02, 1e-3, 1e-5] {
            let found = along(&model, &[time, 0.5], &log);
            for (row, t) in log.time.iter().enumerate().skip(20) {
                let wanted = t - time + (0.5 + time) * (-t / time).exp();
                let off = (found[row] - wanted).abs();
                assert!(off < 2e-3 + 0.5 * 0.005, "{time}, row {row}: {off}");
                // Slow enough for the step to follow: second order.
                assert!(time < 0.02 || off < 1e-3, "{time}, row {row}: {off}");
            }
        }
    }
}
