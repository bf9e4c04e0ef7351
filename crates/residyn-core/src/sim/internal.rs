//! The internal states of a model along the motion of a log: its effects' memory of what came before.
//!
//! Where a motion is measured, the states of effects do not depend on how well the model predicts it. They are integrated
//! along the log, once for each set of parameters, and then stand beside the measured columns.

use super::scheme::{HEUN, Scheme};
use super::{Commands, Point};
use crate::data::{Log, Measured, half_width_s, local_cubic};
use crate::expr::{Graph, Node, Program, Tape};
use crate::lanes::Row;
use crate::model::{Dependence, Dynamics, Filter, InputLayout, InternalStates};

/// Logs that are walked along side by side.
const LANES: usize = 8;
/// Rows nearer together than this, s, are taken as one step: what dry friction remembers depends on the way alone, and
/// states that decay are accurate to second order in the step.
const STEP_S: f64 = 4e-3;
const SCHEME: &Scheme = HEUN;

/// The angles of a log (`[joint][row]`, rad or m), each smoothed by the rows around it.
#[derive(Debug, Clone)]
pub struct LoggedMotion {
    /// s
    time: Vec<f64>,
    q: Vec<Vec<f64>>,
    /// The rows between which steps are taken.
    grid: Vec<usize>,
}

impl LoggedMotion {
    pub fn of(log: &Log) -> Self {
        let half_width = half_width_s(log.median_step());
        let smoothed = |q: &Vec<f64>| {
            let at = |row: usize| {
                let found = local_cubic(&log.time, q, row, half_width);
                found.map_or(q[row], |found| found.value)
            };
            (0..log.rows()).map(at).collect()
        };
        let mut grid = vec![0];
        for row in 1..log.rows() {
            let last = grid[grid.len() - 1];
            // Logged times are rounded decimals.
            if log.time[row] - log.time[last] > 0.99 * STEP_S || row + 1 == log.rows() {
                grid.push(row);
            }
        }
        Self {
            time: log.time.clone(),
            q: log.q.iter().map(smoothed).collect(),
            grid,
        }
    }
}

/// The rates of a model's internal states, with their derivatives if slopes are asked for.
///
/// Inputs: those of the model's program. Outputs: the rates; for each its derivatives with respect to the internal states,
/// to those at the step's start, to the `columns`, and to the torques of the filters.
#[derive(Debug, Clone)]
pub struct InternalRates {
    program: Program,
    layout: InputLayout,
    internal: InternalStates,
    /// The starts' derivatives, `[state * columns + column]`, from the model's parameters.
    start_slopes: Program,
    filters: Vec<Filter>,
    /// Parameters of the model with respect to which there are slopes.
    columns: Vec<usize>,
    reads_torques: bool,
}

impl InternalRates {
    /// The rates alone; `None` for a model without internal states.
    pub fn plain(dynamics: &Dynamics) -> Option<Self> {
        let internal = dynamics.internal.as_ref()?;
        Some(Self::new(dynamics, internal, Vec::new()))
    }

    /// With the slopes of [`InternalStates::pairs`].
    pub fn with_slopes(dynamics: &Dynamics) -> Option<Self> {
        let internal = dynamics.internal.as_ref()?;
        let mut columns: Vec<usize> = internal.pairs.iter().map(|pair| pair.parameter).collect();
        columns.sort_unstable();
        columns.dedup();
        Some(Self::new(dynamics, internal, columns))
    }

    fn new(dynamics: &Dynamics, internal: &InternalStates, columns: Vec<usize>) -> Self {
        let layout = dynamics.layout();
        let read = internal.rates.inputs_read();
        let reads_torques = read[layout.driving()].contains(&true);
        Self {
            program: match columns.is_empty() {
                true => internal.rates.clone(),
                false => differentiated(dynamics, internal, &columns),
            },
            layout,
            start_slopes: start_slopes(internal, &columns),
            internal: internal.clone(),
            filters: dynamics.filters.clone(),
            columns,
            reads_torques,
        }
    }

    /// What there are slopes of.
    pub fn pairs(&self) -> &[Dependence] {
        &self.internal.pairs
    }

    /// The internal states along some logs, each with the model's values in that log.
    pub fn along(&self, cases: &[Case<'_>]) -> Vec<Course> {
        let packs = cases.chunks(LANES);
        packs.flat_map(|pack| self.along_some(pack)).collect()
    }
}

/// The program of [`InternalRates`].
fn differentiated(dynamics: &Dynamics, internal: &InternalStates, columns: &[usize]) -> Program {
    let layout = dynamics.layout();
    let mut graph = Graph::new();
    let names = internal.rates.inputs().iter();
    let inputs: Vec<Node> = names.map(|name| graph.input(name)).collect();
    let rates = graph.append(&internal.rates, &inputs);
    let mut outputs = rates.clone();
    let torques = dynamics.filters.iter();
    let torques = torques.map(|filter| inputs[layout.driving_of(filter.joint)]);
    let torques: Vec<Node> = torques.collect();
    let parameters = columns.iter().map(|k| inputs[layout.parameters() + k]);
    let others: Vec<Node> = parameters.chain(torques).collect();
    let states = [&inputs[layout.internal()], &inputs[layout.starts()]];
    let wrt = [states.concat(), others].concat();
    outputs.extend(graph.jacobian(&rates, &wrt).concat());
    graph.finish(&outputs)
}

fn start_slopes(internal: &InternalStates, columns: &[usize]) -> Program {
    let mut graph = Graph::new();
    let names = internal.starts.inputs().iter();
    let inputs: Vec<Node> = names.map(|name| graph.input(name)).collect();
    let starts = graph.append(&internal.starts, &inputs);
    let wrt: Vec<Node> = columns.iter().map(|k| inputs[*k]).collect();
    let slopes = graph.jacobian(&starts, &wrt).concat();
    graph.finish(&slopes)
}

/// A log with the model's values in it and its filtered commands.
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    pub log: &'a Log,
    pub point: &'a Point<'a>,
    pub motion: &'a LoggedMotion,
    pub commands: &'a Commands<'a>,
}

/// The internal states at the rows of a log, `[state][row]`, and their derivatives with respect to parameters,
/// `[pair][row]` in the order of [`InternalStates::pairs`], if asked for.
#[derive(Debug, Clone, Default)]
pub struct Course {
    pub values: Vec<Vec<f64>>,
    pub slopes: Vec<Vec<f64>>,
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
    courses.pop().map_or_else(Vec::new, |course| course.values)
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
        let at =
            |of: &dyn Fn(&Course) -> &[f64]| Row::from_fn(|lane| of(lanes[lane].0)[lanes[lane].1]);
        let states = 0..lanes[0].0.values.len();
        let slopes = pairs.iter().enumerate();
        Self {
            values: states.map(|k| at(&|course| &course.values[k])).collect(),
            slopes: slopes
                .map(|(k, pair)| (*pair, at(&|course| &course.slopes[k])))
                .collect(),
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
        let LoggedMotion { time, q, grid } = case.motion;
        let at_grid = |channel: &[f64]| grid.iter().map(|row| channel[*row]).collect::<Vec<f64>>();
        let mean = |channel: &Vec<f64>| -> Vec<f64> {
            let steps = grid.windows(2).map(|ends| &channel[ends[0]..ends[1]]);
            steps
                .map(|rows| rows.iter().sum::<f64>() / rows.len() as f64)
                .collect()
        };
        let torques = match self.reads_torques {
            true => case.commands.acting().iter().map(mean).collect(),
            false => vec![vec![0.0; grid.len() - 1]; self.layout.driving().len()],
        };
        let measured = Measured::named(&case.log.measured, case.point.dynamics.measured_names());
        let slope = |filter: &Filter| {
            let means = case.commands.delivered(filter.joint).unwrap_or_default();
            mean(&means.iter().map(|mean| mean.slope(filter.kind)).collect())
        };
        let filters = match self.reads_torques && !self.columns.is_empty() {
            true => self.filters.as_slice(),
            false => &[],
        };
        let measured = measured.into_iter().map(mean);
        Track {
            time: at_grid(time),
            q: q.iter().map(|q| at_grid(q)).collect(),
            given: [torques, measured.collect()].concat(),
            slopes: filters.iter().map(slope).collect(),
        }
    }

    /// The states along a few logs: at each row of its grid, the states, then their slopes by each column.
    fn along_some(&self, cases: &[Case<'_>]) -> Vec<Course> {
        let tracks: Vec<Track> = cases.iter().map(|case| self.track(case)).collect();
        let mut walk = Walk::new(self, cases);
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
        let each = courses.iter().zip(cases);
        each.map(|(course, case)| self.course(course, case.motion))
            .collect()
    }

    /// The course at all rows of its log.
    fn course(&self, at_grid: &[Vec<f64>], motion: &LoggedMotion) -> Course {
        let at_rows = |channel: &Vec<f64>| motion.at_rows(channel);
        let states = self.internal.names.len();
        let slope = |pair: &Dependence| {
            let column = self.columns.binary_search(&pair.parameter).ok()?;
            Some(at_rows(&at_grid[states * (1 + column) + pair.state]))
        };
        Course {
            values: at_grid[..states].iter().map(at_rows).collect(),
            slopes: self.internal.pairs.iter().filter_map(slope).collect(),
        }
    }
}

impl Track {
    fn steps(&self) -> usize {
        self.time.len() - 1
    }
}

impl LoggedMotion {
    /// A channel that is given at the rows of the grid, at all rows.
    fn at_rows(&self, channel: &[f64]) -> Vec<f64> {
        let time = &self.time;
        let mut all = vec![channel[0]; time.len()];
        for (ends, values) in self.grid.windows(2).zip(channel.windows(2)) {
            let slope = (values[1] - values[0]) / (time[ends[1]] - time[ends[0]]);
            for row in ends[0]..=ends[1] {
                all[row] = values[0] + slope * (time[row] - time[ends[0]]);
            }
        }
        all
    }
}

/// Steps along logs, one in each lane.
struct Walk<'r> {
    rates: &'r InternalRates,
    tape: Tape<f64, LANES>,
    /// The states, then the slopes of all states by each column.
    now: Vec<Row<f64, LANES>>,
}

impl<'r> Walk<'r> {
    /// Before the first row of each log.
    fn new(rates: &'r InternalRates, cases: &[Case<'_>]) -> Self {
        let first = rates.layout.parameters();
        let mut tape = rates.program.tape_at(first, cases[0].point.values());
        let at = |lane: usize| cases[lane.min(cases.len() - 1)].point.values();
        for (k, input) in tape.inputs()[first..].iter_mut().enumerate() {
            *input = Row::from_fn(|lane| at(lane)[k]);
        }
        let starts = |lane: usize| {
            let values = rates.internal.starts.eval(at(lane)).into_iter();
            let slopes = rates.start_slopes.eval(at(lane));
            let (states, columns) = (rates.internal.names.len(), rates.columns.len());
            let of_column = |k: usize| slopes[k % states * columns + k / states];
            values
                .chain((0..states * columns).map(of_column))
                .collect::<Vec<f64>>()
        };
        let starts: Vec<Vec<f64>> = (0..LANES).map(starts).collect();
        let now = Row::table(starts[0].len(), |k, lane| starts[lane][k]);
        Self { rates, tape, now }
    }

    /// Move along one step of each log; lanes whose log has ended stay where they are.
    fn step(&mut self, tracks: &[Track], step: usize) {
        let layout = self.rates.layout;
        let track = |lane: usize| tracks.get(lane).filter(|track| step < track.steps());
        let read = |of: &dyn Fn(&Track) -> f64| Row::from_fn(|lane| track(lane).map_or(0.0, of));
        let h = read(&|track| track.time[step + 1] - track.time[step]);
        let states = self.rates.internal.names.len();
        let filters = 0..tracks[0].slopes.len();
        let filters = filters.map(|k| read(&|track| track.slopes[k][step]));
        let filters: Vec<Row<f64, LANES>> = filters.collect();
        let inputs = self.tape.moving();
        for (k, place) in layout.given().enumerate() {
            inputs[place] = read(&|track| track.given[k][step]);
        }
        for (joint, place) in layout.velocities().enumerate() {
            inputs[place] = read(&|track| {
                let q = &track.q[joint];
                (q[step + 1] - q[step]) / (track.time[step + 1] - track.time[step])
            });
        }
        inputs[layout.starts()].copy_from_slice(&self.now[..states]);
        inputs[layout.step()] = h;
        let (mut sum, mut inner) = (self.now.clone(), self.now.clone());
        for stage in SCHEME.stages {
            let inputs = self.tape.moving();
            for joint in layout.positions() {
                inputs[joint] = read(&|track| {
                    let q = &track.q[joint];
                    q[step] + stage.time * (q[step + 1] - q[step])
                });
            }
            let time = |track: &Track| track.time[step];
            inputs[layout.time()] = read(&time);
            for lane in 0..LANES {
                inputs[layout.time()][lane] += stage.time * h[lane];
            }
            inputs[layout.internal()].copy_from_slice(&inner[..states]);
            self.tape.run();
            let slopes = self.slopes(&inner, &filters);
            for (k, slope) in slopes.iter().enumerate() {
                for lane in 0..LANES {
                    sum[k][lane] += stage.weight * h[lane] * slope[lane];
                    inner[k][lane] = self.now[k][lane] + stage.reach * h[lane] * slope[lane];
                }
            }
        }
        self.now = sum;
    }

    /// The rates of the states and of their slopes, where these are `inner` and the tape has run.
    fn slopes(
        &self,
        inner: &[Row<f64, LANES>],
        filters: &[Row<f64, LANES>],
    ) -> Vec<Row<f64, LANES>> {
        let (states, columns) = (self.rates.internal.names.len(), self.rates.columns.len());
        let mut slopes: Vec<Row<f64, LANES>> = (0..states).map(|k| *self.tape.output(k)).collect();
        let each = 2 * states + columns + self.rates.filters.len();
        for column in 0..columns {
            for state in 0..states {
                let by = |k: usize| self.tape.output(states + each * state + k);
                let mut slope = *by(2 * states + column);
                let mut add = |by: &Row<f64, LANES>, of: &Row<f64, LANES>| {
                    (0..LANES).for_each(|lane| slope[lane] += by[lane] * of[lane]);
                };
                let own = |state: usize| states * (1 + column) + state;
                for other in 0..states {
                    add(by(other), &inner[own(other)]);
                    add(by(states + other), &self.now[own(other)]);
                }
                let parameter = self.rates.columns[column];
                let filtered = self.rates.filters.iter().zip(filters).enumerate();
                for (k, (filter, slope)) in filtered {
                    if filter.parameter == parameter {
                        add(by(2 * states + columns + k), slope);
                    }
                }
                slopes.push(slope);
            }
        }
        slopes
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
        let mut effect = FittedEffect::absent(&BRISTLES.parse().unwrap(), joint);
        for (value, parameter) in effect.values.iter_mut().zip(&effect.effect.parameters) {
            value.0 = parameter.typical;
        }
        effect
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
        let log = log(|t| t, 0.005);
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
