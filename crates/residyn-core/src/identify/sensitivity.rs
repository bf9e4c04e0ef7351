use std::ops::Range;

use crate::expr::{Graph, Node, Program, Tape};
use crate::lanes::{Row, Simd, WithSimd};
use crate::model::{Dependence, Dynamics, Filter, InputLayout};
use crate::sim::{Hold, InternalRates, InternalStart, Scheme, StepTorque};

/// Windows that are integrated side by side: two AVX-512 registers or four AVX2 registers of f64.
pub(super) const LANES: usize = 16;
pub(super) type Lane = Row<f64, LANES>;

/// The free values of each window, besides the parameters that all windows share.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Local {
    /// The state at the window's start.
    State,
    /// The start state and a constant generalised force per joint, which stands for the dynamics that the model lacks.
    StateAndForce,
    /// None: the torques of a known motion.
    Nothing,
}

/// The tangent-linear model: accelerations and their derivatives with respect to states, shared parameters and forces,
/// as one program.
///
/// Outputs: the n accelerations and the rates of the internal states; per joint the derivatives of its acceleration with
/// respect to all states; per active parameter, and per force if forces are free, the derivatives of all these slopes; then
/// those that `rates_by_state` and `by_start` place. dq/dt is qd, or that and a jump: the jumps follow the rates. Of a
/// torque balance: the n differences, then for each difference its derivatives with respect to the active parameters that
/// it depends on. Inputs: those of the model, with the derivatives of the torques with respect to filter parameters, and
/// in a torque balance those of the internal states with respect to parameters, inserted before its parameters.
pub(super) struct Tangent {
    pub program: Program,
    /// The sensor model, if it is not the identity: the n measured angles; per joint their derivatives with respect to
    /// `q` and `qd`; per joint those with respect to active parameters. Inputs: those of the model.
    pub reading: Option<Program>,
    /// How internal states and their slopes follow from a logged motion, if there are any.
    pub internal: Option<InternalRates>,
    pub joints: usize,
    /// The inputs of the model.
    pub layout: InputLayout,
    /// Index of the first parameter among the inputs.
    pub first_parameter: usize,
    /// Indices into the model's parameters.
    pub active: Vec<usize>,
    /// The derivatives of each internal state's rate, then of each jump, with respect to states.
    rates_by_state: Vec<Sparse>,
    /// Those of each acceleration, then of each of these rates and jumps, with respect to internal states at the step's
    /// start.
    by_start: Vec<Sparse>,
    /// For a torque balance, the columns that each joint's difference depends on; else empty.
    pub columns_of: Vec<Vec<usize>>,
    /// Number of free values of one window.
    start_states: usize,
}

/// The derivatives of a slope that are not zero: the state that each is with respect to, and its output.
type Sparse = Vec<(usize, usize)>;

impl Tangent {
    pub fn new(dynamics: &Dynamics, active: &[usize], local: Local) -> Self {
        let (n, layout) = (dynamics.joints, dynamics.layout());
        let first = match local {
            Local::State | Local::StateAndForce => layout.parameters(),
            Local::Nothing => layout.parameters_of_balance(),
        };
        let internal = InternalRates::with_slopes(dynamics, active);
        let pairs = match (local, &internal) {
            (Local::Nothing, Some(internal)) => internal.pairs().to_vec(),
            _ => Vec::new(),
        };
        let model = Differentiated::new(dynamics, first, &pairs);
        let (start_states, reading, compiled) = match local {
            Local::State => (
                2 * n,
                reading(dynamics, active),
                model.of_motion(active, 0..0),
            ),
            Local::StateAndForce => {
                let motion = model.of_motion(active, layout.driving());
                (3 * n, reading(dynamics, active), motion)
            }
            Local::Nothing => (0, None, model.of_torques(active)),
        };
        let Compiled {
            program,
            rates_by_state,
            by_start,
            columns_of,
        } = compiled;
        Self {
            program,
            reading,
            rates_by_state,
            by_start,
            internal,
            joints: n,
            layout,
            first_parameter: first + dynamics.filters.len() + pairs.len(),
            active: active.to_vec(),
            columns_of,
            start_states,
        }
    }

    /// Columns of the sensitivities: shared parameters, then the window's own free values.
    pub fn columns(&self) -> usize {
        self.active.len() + self.start_states
    }

    /// The first output with the partial derivatives df/dc of a column c, or `None` if they are zero. Column 0 is the
    /// state itself, whose slopes are the accelerations.
    #[inline(always)]
    fn direct(&self, column: usize) -> Option<usize> {
        let (n, shared, slopes) = (self.joints, self.active.len(), self.slope_count());
        let others = slopes + n * self.states();
        match column.checked_sub(1) {
            None => Some(0),
            Some(parameter) if parameter < shared => Some(others + slopes * parameter),
            Some(state) if state < shared + 2 * n => None,
            Some(force) => Some(others + slopes * (force - 2 * n)),
        }
    }

    /// Number of states of a motion, internal ones included.
    fn states(&self) -> usize {
        self.layout.states().len()
    }

    /// Number of slopes that the program gives: accelerations, rates of internal states, and jumps.
    fn slope_count(&self) -> usize {
        self.by_start.len()
    }

    /// Whether angles have rates beyond their velocities.
    fn has_jumps(&self) -> bool {
        self.slope_count() == self.states()
    }

    /// The output with the derivative of a joint's acceleration with respect to a state.
    pub fn by_state(&self, joint: usize, state: usize) -> usize {
        self.slope_count() + joint * self.states() + state
    }

    /// The output with the derivative of an internal state's rate with respect to a state, unless it is zero.
    pub fn rate_by_state(&self, internal: usize, state: usize) -> Option<usize> {
        let mut row = self.rates_by_state[internal].iter();
        row.find(|(own, _)| *own == state)
            .map(|(_, output)| *output)
    }

    /// For a torque balance: for each joint the columns that its difference depends on, and the outputs with its slopes
    /// with respect to them.
    pub fn slopes(&self) -> impl Iterator<Item = (&[usize], Range<usize>)> {
        let mut next = self.joints;
        self.columns_of.iter().map(move |columns| {
            let first = next;
            next += columns.len();
            (columns.as_slice(), first..next)
        })
    }
}

/// A program of [`Tangent`] with the places of its outputs.
struct Compiled {
    program: Program,
    rates_by_state: Vec<Sparse>,
    by_start: Vec<Sparse>,
    columns_of: Vec<Vec<usize>>,
}

/// A model's program in a graph, to be differentiated.
struct Differentiated<'d> {
    dynamics: &'d Dynamics,
    graph: Graph,
    /// The program's inputs, of which the parameters begin at `first_parameter`.
    inputs: Vec<Node>,
    first_parameter: usize,
    /// The derivatives of the torques with respect to filter parameters.
    slopes: Vec<Node>,
    /// Those of internal states with respect to parameters, if the log gives the states.
    pairs: Vec<(Dependence, Node)>,
    outputs: Vec<Node>,
}

impl<'d> Differentiated<'d> {
    fn new(dynamics: &'d Dynamics, first_parameter: usize, pairs: &[Dependence]) -> Self {
        let mut graph = Graph::new();
        let (moving, held) = dynamics.program.inputs().split_at(first_parameter);
        let mut inputs: Vec<Node> = moving.iter().map(|name| graph.input(name)).collect();
        let slope = |filter: &Filter| graph.input(&format!("slope of {}", filter.parameter));
        let slopes = dynamics.filters.iter().map(slope).collect();
        let pair = |pair: &Dependence| {
            let name = format!("slope of state {} by {}", pair.state, pair.parameter);
            (*pair, graph.input(&name))
        };
        let pairs = pairs.iter().map(pair).collect();
        inputs.extend(held.iter().map(|name| graph.input(name)));
        Self {
            outputs: graph.append(&dynamics.program, &inputs),
            dynamics,
            graph,
            inputs,
            first_parameter,
            slopes,
            pairs,
        }
    }

    /// The derivatives of `outputs` with respect to the inputs `states`, to the `active` parameters, which act through
    /// filters and given internal states as well, and to the inputs `forces`.
    fn jacobian(
        &mut self,
        outputs: &[Node],
        states: Range<usize>,
        active: &[usize],
        forces: Range<usize>,
    ) -> Vec<Vec<Node>> {
        let first_active = states.len();
        let parameters = active.iter().map(|k| self.first_parameter + k);
        let wrt = states.chain(parameters).chain(forces);
        let wrt: Vec<Node> = wrt.map(|input| self.inputs[input]).collect();
        let mut jacobian = self.graph.jacobian(outputs, &wrt);
        for (filter, slope) in self.dynamics.filters.iter().zip(&self.slopes) {
            let Some(column) = active.iter().position(|&k| k == filter.parameter) else {
                continue;
            };
            let torque = self.inputs[self.dynamics.layout().driving_of(filter.joint)];
            let by_torque = self.graph.jacobian(outputs, &[torque]);
            for (row, by_torque) in jacobian.iter_mut().zip(by_torque) {
                row[first_active + column] = self.graph.mul(by_torque[0], *slope);
            }
        }
        if self.pairs.is_empty() {
            return jacobian;
        }
        let internal = &self.inputs[self.dynamics.layout().internal()];
        let by_internal = self.graph.jacobian(outputs, internal);
        for (Dependence { state, parameter }, slope) in &self.pairs {
            let Some(column) = active.iter().position(|k| k == parameter) else {
                continue;
            };
            for (row, by_internal) in jacobian.iter_mut().zip(&by_internal) {
                let through = self.graph.mul(by_internal[*state], *slope);
                let own = &mut row[first_active + column];
                *own = self.graph.add(*own, through);
            }
        }
        jacobian
    }

    /// The program of [`Tangent`] for a motion; no difference of torques depends on a column.
    fn of_motion(mut self, active: &[usize], forces: Range<usize>) -> Compiled {
        let mut slopes = self.outputs.split_off(self.dynamics.joints);
        let layout = self.dynamics.layout();
        let velocities = &self.inputs[layout.velocities()];
        if self.outputs != velocities {
            let both = self.outputs.iter().zip(velocities);
            slopes.extend(both.map(|(rate, velocity)| self.graph.sub(*rate, *velocity)));
        }
        let states = layout.states();
        let jacobian = self.jacobian(&slopes, states.clone(), active, forces.clone());
        let (of_joints, of_internal) = jacobian.split_at(self.dynamics.joints);
        let by_states = of_joints.iter().flat_map(|row| &row[states.clone()]);
        let others = states.end..states.end + active.len() + forces.len();
        let others = others.flat_map(|k| jacobian.iter().map(move |row| &row[k]));
        let of_starts = (self.graph).jacobian(&slopes, &self.inputs[layout.starts()]);
        let all = slopes.iter().chain(by_states).chain(others);
        let mut all: Vec<Node> = all.copied().collect();
        let mut placed = |row: &[Node], first: usize| {
            let mut places = Vec::new();
            for (k, slope) in row.iter().enumerate() {
                if !self.graph.is_zero(*slope) {
                    places.push((first + k, all.len()));
                    all.push(*slope);
                }
            }
            places
        };
        let rates_by_state = of_internal
            .iter()
            .map(|row| placed(&row[states.clone()], 0));
        let rates_by_state = rates_by_state.collect();
        let by_start = of_starts
            .iter()
            .map(|row| placed(row, layout.internal().start));
        Compiled {
            rates_by_state,
            by_start: by_start.collect(),
            program: self.graph.finish(&all),
            columns_of: Vec::new(),
        }
    }

    /// The program of [`Tangent`] for a torque balance, and the columns that each difference depends on.
    fn of_torques(mut self, active: &[usize]) -> Compiled {
        let differences = std::mem::take(&mut self.outputs);
        let jacobian = self.jacobian(&differences, 0..0, active, 0..0);
        let depends = |row: &Vec<Node>| -> Vec<usize> {
            let columns = 0..row.len();
            columns
                .filter(|column| !self.graph.is_zero(row[*column]))
                .collect()
        };
        let columns_of: Vec<Vec<usize>> = jacobian.iter().map(depends).collect();
        let own = jacobian.iter().zip(&columns_of);
        let slopes = own.flat_map(|(row, columns)| columns.iter().map(|column| row[*column]));
        let outputs: Vec<Node> = differences.into_iter().chain(slopes).collect();
        Compiled {
            program: self.graph.finish(&outputs),
            rates_by_state: Vec::new(),
            by_start: Vec::new(),
            columns_of,
        }
    }
}

/// The program of [`Tangent::reading`].
fn reading(dynamics: &Dynamics, active: &[usize]) -> Option<Program> {
    let layout = dynamics.layout();
    let mut graph = Graph::new();
    let names = dynamics.program.inputs();
    let inputs: Vec<_> = names.iter().map(|name| graph.input(name)).collect();
    let shown = graph.append(dynamics.reading.as_ref()?, &inputs);
    let parameters = active.iter().map(|k| inputs[layout.parameters() + k]);
    let parameters: Vec<_> = parameters.collect();
    let by_state = graph.jacobian(&shown, &inputs[layout.states()]).concat();
    let by_parameter = graph.jacobian(&shown, &parameters).concat();
    Some(graph.finish(&[shown, by_state, by_parameter].concat()))
}

/// Integrates the states and their sensitivities together.
///
/// The sensitivity S of the state with respect to a column c obeys dS/dt = (df/ds) S + df/dc. Rows are positions,
/// velocities, then internal states, whose rates depend on those at the step's start as well.
pub(super) struct TangentStepper<'t> {
    tangent: &'t Tangent,
    scheme: &'static Scheme,
    torque: StepTorque<LANES>,
    tape: Tape<f64, LANES>,
    /// The state, then the sensitivity of each column: one row for each state.
    now: Vec<Lane>,
    inner: Vec<Lane>,
    next: Vec<Lane>,
    sum: Vec<Lane>,
    /// Derivatives of the accelerations with respect to the states, `[joint * states + state]`.
    by_state: Vec<Lane>,
    reading: Option<Tape<f64, LANES>>,
    /// The measured angles, then their sensitivities `[joint * columns + column]`.
    shown: Vec<Lane>,
}

impl<'t> TangentStepper<'t> {
    pub fn new(tangent: &'t Tangent, values: &[f64], scheme: &'static Scheme) -> Self {
        let n = tangent.joints;
        let first_read = tangent.layout.parameters();
        let rows = |count: usize| vec![Row::splat(0.0); count];
        let size = tangent.states() * (1 + tangent.columns());
        Self {
            tangent,
            scheme,
            torque: StepTorque::default(),
            tape: tangent.program.tape_at(tangent.first_parameter, values),
            now: rows(size),
            inner: rows(size),
            next: rows(size),
            sum: rows(size),
            by_state: rows(n * tangent.states()),
            reading: (tangent.reading.as_ref()).map(|reading| reading.tape_at(first_read, values)),
            shown: rows(n * (1 + tangent.columns())),
        }
    }

    /// Set the value of a parameter in one lane.
    pub fn set_in_lane(&mut self, parameter: usize, lane: usize, value: f64) {
        self.tape.inputs()[self.tangent.first_parameter + parameter][lane] = value;
        if let Some(reading) = &mut self.reading {
            reading.inputs()[self.tangent.layout.parameters() + parameter][lane] = value;
        }
    }

    /// The measured angles (`[n]`) and their sensitivities (`[joint * columns + column]`). `given` are the torques that acted
    /// until now, and the model's further measured columns.
    pub fn shown(&mut self, given: impl FnOnce() -> Vec<Lane>, time: Lane) -> (&[Lane], &[Lane]) {
        let (n, columns) = (self.tangent.joints, self.tangent.columns());
        let states = self.tangent.states();
        let (state, sensitivities) = self.now.split_at(states);
        let (angles, slopes) = self.shown.split_at_mut(n);
        let Some(reading) = &mut self.reading else {
            angles.copy_from_slice(&state[..n]);
            for (joint, slopes) in slopes.chunks_exact_mut(columns).enumerate() {
                for (slope, column) in slopes.iter_mut().zip(sensitivities.chunks_exact(states)) {
                    *slope = column[joint];
                }
            }
            return (angles, slopes);
        };
        let (inputs, layout) = (reading.moving(), self.tangent.layout);
        inputs[layout.states()].copy_from_slice(state);
        inputs[layout.given()].copy_from_slice(&given());
        inputs[layout.time()] = time;
        reading.run();
        let shared = self.tangent.active.len();
        for (joint, slopes) in slopes.chunks_exact_mut(columns).enumerate() {
            angles[joint] = *reading.output(joint);
            for (column, slope) in slopes.iter_mut().enumerate() {
                let direct = n + n * states + joint * shared + column;
                *slope = if column < shared {
                    *reading.output(direct)
                } else {
                    Row::splat(0.0)
                };
                for (state, own) in sensitivities[states * column..][..states]
                    .iter()
                    .enumerate()
                {
                    let by_state = reading.output(n + joint * states + state);
                    for lane in 0..LANES {
                        slope[lane] += by_state[lane] * own[lane];
                    }
                }
            }
        }
        (angles, slopes)
    }

    /// Start at this motion (`[2n][lane]`), whose sensitivity to itself is the identity, and at these internal states with
    /// their slopes by parameters. All other sensitivities are zero.
    pub fn start(&mut self, motion: &[Lane], internal: &InternalStart<LANES>) {
        let (n, shared) = (self.tangent.joints, self.tangent.active.len());
        let states = self.tangent.states();
        self.now.fill(Row::splat(0.0));
        self.now[..2 * n].copy_from_slice(&motion[..2 * n]);
        self.now[2 * n..states].copy_from_slice(&internal.values);
        for row in 0..2 * n {
            self.now[states * (1 + shared + row) + row] = Row::splat(1.0);
        }
        for (Dependence { state, parameter }, slope) in &internal.slopes {
            let column = self.tangent.active.iter().position(|k| k == parameter);
            if let Some(column) = column {
                self.now[states * (1 + column) + 2 * n + state] = *slope;
            }
        }
    }

    /// Move states and sensitivities to the end of a hold.
    pub fn advance(&mut self, hold: &Hold<'_, LANES>) {
        self.torque.fill(hold);
        Lane::dispatch(Advance {
            stepper: self,
            time: hold.from,
            length: hold.length,
            substeps: hold.substeps,
        });
    }

    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, time: &Lane, h: &Lane) {
        let layout = self.tangent.layout;
        let (slopes, states) = (self.tangent.slope_count(), self.tangent.states());
        let last = self.scheme.stages.len() - 1;
        if !layout.internal().is_empty() {
            let inputs = self.tape.moving();
            inputs[layout.starts()].copy_from_slice(&self.now[layout.internal()]);
            inputs[layout.step()] = *h;
        }
        for (k, stage) in self.scheme.stages.iter().enumerate() {
            let inner = if k == 0 { &self.now } else { &self.inner };
            let inputs = self.tape.moving();
            inputs[layout.states()].copy_from_slice(&inner[..states]);
            let (mut weighed, mut reached) = (*h, *h);
            for part in 0..Lane::parts::<S>() {
                let h = h.get(simd, part);
                inputs[layout.time()]
                    .set(part, h.mul_add(h.like(stage.time), time.get(simd, part)));
                weighed.set(part, h * h.like(stage.weight));
                reached.set(part, h * h.like(stage.reach));
            }
            self.tape.run_on(simd);
            for (k, slope) in self.by_state.iter_mut().enumerate() {
                *slope = *self.tape.output(slopes + k);
            }
            self.limit_damping(simd, h);
            // Known at compile time in each call: the loops over rows have no branches.
            match (k == 0, k == last) {
                (true, true) => self.stage(simd, true, true, &weighed, &reached),
                (true, false) => self.stage(simd, true, false, &weighed, &reached),
                (false, true) => self.stage(simd, false, true, &weighed, &reached),
                (false, false) => self.stage(simd, false, false, &weighed, &reached),
            }
            std::mem::swap(&mut self.inner, &mut self.next);
        }
        if self.scheme.semi_implicit {
            self.move_with_new_velocities(simd, h);
        }
        std::mem::swap(&mut self.now, &mut self.sum);
    }

    /// Scale the derivatives with respect to each velocity if their damping, over one step, is more than the scheme can
    /// follow. A joint that sticks is damped far more strongly: its motion stays small, but its sensitivities would
    /// grow without bound although they really vanish.
    #[inline(always)]
    fn limit_damping<S: Simd>(&mut self, simd: S, h: &Lane) {
        let (n, states) = (self.tangent.joints, self.tangent.states());
        for part in 0..Lane::parts::<S>() {
            let h = h.get(simd, part);
            // The friction of each joint gives a matrix without negative eigenvalues, none of which exceeds their sum.
            let mut all = h.like(0.0);
            for j in 0..n {
                let damping = -(self.by_state[(states + 1) * j + n].get(simd, part) * h);
                all = all + damping.max(h.like(0.0));
            }
            let limit = h.like(self.scheme.most_damping);
            if !limit.any_less(all) {
                continue;
            }
            let most = h.like(self.scheme.most_damping / n as f64);
            for j in 0..n {
                let damping = -(self.by_state[(states + 1) * j + n].get(simd, part) * h);
                let share = most.if_less(damping, most / damping, h.like(1.0));
                let share = limit.if_less(all, share, h.like(1.0));
                for row in 0..n {
                    let slope = &mut self.by_state[states * row + n + j];
                    slope.set(part, slope.get(simd, part) * share);
                }
            }
        }
    }

    /// Move positions with the new velocities: q += h (v' - v), and the same for the sensitivities.
    #[inline(always)]
    fn move_with_new_velocities<S: Simd>(&mut self, simd: S, h: &Lane) {
        let (n, states) = (self.tangent.joints, self.tangent.states());
        let columns = self.sum.chunks_exact_mut(states);
        let columns = self.now.chunks_exact(states).zip(columns);
        for (now, sum) in columns {
            for part in 0..Lane::parts::<S>() {
                for j in 0..n {
                    let gain = sum[n + j].get(simd, part) - now[n + j].get(simd, part);
                    let moved = gain.mul_add(h.get(simd, part), sum[j].get(simd, part));
                    sum[j].set(part, moved);
                }
            }
        }
    }

    /// Accumulate the slopes of a stage times their share of the step, and compute the states of the next.
    #[inline(always)]
    fn stage<S: Simd>(
        &mut self,
        simd: S,
        is_first: bool,
        is_last: bool,
        weighed: &Lane,
        reached: &Lane,
    ) {
        // With the number of joints known at compile time, the loops over rows are unrolled.
        match (self.tangent.joints, self.tangent.layout.internal().len()) {
            (1, 0) => self.stage_of(simd, 1, is_first, is_last, weighed, reached),
            (2, 0) => self.stage_of(simd, 2, is_first, is_last, weighed, reached),
            (n, 0) => self.stage_of(simd, n, is_first, is_last, weighed, reached),
            _ => self.stage_with_memory(simd, is_first, is_last, weighed, reached),
        }
    }

    /// The stage of a model without internal states.
    #[inline(always)]
    fn stage_of<S: Simd>(
        &mut self,
        simd: S,
        n: usize,
        is_first: bool,
        is_last: bool,
        weighed: &Lane,
        reached: &Lane,
    ) {
        let rows = 2 * n;
        let inner = if is_first { &self.now } else { &self.inner };
        let columns = columns(rows, [&self.now, inner], [&mut self.next, &mut self.sum]);
        let by_state = &self.by_state[..n * rows];
        for (column, ([now, inner], [next, sum])) in columns {
            let direct = self.tangent.direct(column);
            for part in 0..Lane::parts::<S>() {
                let (weighed, reached) = (weighed.get(simd, part), reached.get(simd, part));
                for row in 0..rows {
                    let mut slope = match (row < n, direct) {
                        (true, _) => inner[n + row].get(simd, part),
                        (false, Some(first)) => self.tape.output(first + row - n).get(simd, part),
                        (false, None) => weighed.like(0.0),
                    };
                    if row >= n && column > 0 {
                        for state in 0..rows {
                            let by_state = by_state[(row - n) * rows + state].get(simd, part);
                            slope = by_state.mul_add(inner[state].get(simd, part), slope);
                        }
                    }
                    let now = now[row].get(simd, part);
                    let before = if is_first {
                        now
                    } else {
                        sum[row].get(simd, part)
                    };
                    sum[row].set(part, slope.mul_add(weighed, before));
                    if !is_last {
                        next[row].set(part, slope.mul_add(reached, now));
                    }
                }
            }
        }
    }

    /// The stage of a model with internal states, most of whose derivatives are zero: only the others are met, each for
    /// all registers of a row in turn.
    #[inline(always)]
    fn stage_with_memory<S: Simd>(
        &mut self,
        simd: S,
        is_first: bool,
        is_last: bool,
        weighed: &Lane,
        reached: &Lane,
    ) {
        let Self { tangent, tape, .. } = self;
        let (n, rows, has_jumps) = (tangent.joints, tangent.states(), tangent.has_jumps());
        let inner = if is_first { &self.now } else { &self.inner };
        let columns = columns(rows, [&self.now, inner], [&mut self.next, &mut self.sum]);
        for (column, ([now, inner], [next, sum])) in columns {
            let direct = tangent.direct(column);
            for row in 0..rows {
                // Among the slopes: jumps are the last.
                let place = if row < n { rows + row } else { row } - n;
                let is_position = row < n;
                let own = direct.filter(|_| !is_position || has_jumps);
                let mut slope = match is_position {
                    true => inner[n + row],
                    false => Row::splat(0.0),
                };
                if let Some(first) = own {
                    add(simd, &mut slope, tape.output(first + place));
                }
                if column > 0 && (!is_position || has_jumps) {
                    if place < n {
                        let by_state = &self.by_state[place * rows..][..rows];
                        for (by, state) in by_state.iter().zip(inner) {
                            add_product(simd, &mut slope, by, state);
                        }
                    } else {
                        for (state, output) in &tangent.rates_by_state[place - n] {
                            add_product(simd, &mut slope, tape.output(*output), &inner[*state]);
                        }
                    }
                    for (state, output) in &tangent.by_start[place] {
                        add_product(simd, &mut slope, tape.output(*output), &now[*state]);
                    }
                }
                let before = if is_first { now[row] } else { sum[row] };
                sum[row] = before;
                add_product(simd, &mut sum[row], &slope, weighed);
                if !is_last {
                    next[row] = now[row];
                    add_product(simd, &mut next[row], &slope, reached);
                }
            }
        }
    }
}

/// The rows of a derivative: those at the start of a step and in a stage of it, and those of the next stage and of the sum over
/// stages.
type Rows<'a> = ([&'a [Lane]; 2], [&'a mut [Lane]; 2]);

/// Each derivative and its rows.
#[inline(always)]
fn columns<'a>(
    rows: usize,
    [now, inner]: [&'a [Lane]; 2],
    [next, sum]: [&'a mut [Lane]; 2],
) -> impl Iterator<Item = (usize, Rows<'a>)> {
    let read = now.chunks_exact(rows).zip(inner.chunks_exact(rows));
    let written = next.chunks_exact_mut(rows).zip(sum.chunks_exact_mut(rows));
    let columns = read.zip(written).enumerate();
    columns.map(|(column, (read, written))| (column, (read.into(), written.into())))
}

/// Add a row to another, register by register.
#[inline(always)]
fn add<S: Simd>(simd: S, sum: &mut Lane, own: &Lane) {
    for part in 0..Lane::parts::<S>() {
        sum.set(part, sum.get(simd, part) + own.get(simd, part));
    }
}

/// Add the product of two rows to another, register by register.
#[inline(always)]
fn add_product<S: Simd>(simd: S, sum: &mut Lane, by: &Lane, of: &Lane) {
    for part in 0..Lane::parts::<S>() {
        let product = by
            .get(simd, part)
            .mul_add(of.get(simd, part), sum.get(simd, part));
        sum.set(part, product);
    }
}

struct Advance<'a, 't> {
    stepper: &'a mut TangentStepper<'t>,
    time: Lane,
    length: Lane,
    substeps: usize,
}

impl WithSimd for Advance<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let layout = self.stepper.tangent.layout;
        let h = Row(self.length.map(|length| length / self.substeps as f64));
        for part in 0..self.substeps {
            let (given, slopes) = self.stepper.torque.part(layout.given().len(), part);
            let inputs = self.stepper.tape.moving();
            inputs[layout.given()].copy_from_slice(given);
            inputs[layout.parameters()..].copy_from_slice(slopes);
            self.stepper.step(simd, &self.time, &h);
            for lane in 0..LANES {
                self.time[lane] += h[lane];
            }
        }
    }
}

#[cfg(test)]
mod tests {

    use super::{LANES, Local, Tangent, TangentStepper};
    use crate::data::Joint;
    use crate::lanes::Row;
    use crate::model::{Dependence, Dynamics, FittedEffect, Library, elastic, loose, viscous};
    use crate::sim::bristles;
    use crate::sim::{Commands, Hold, InternalStart, Point, RK4, SCHEMES, Scheme, Simulator};

    const HELD: [f64; 2] = [0.5, -1.5];

    /// Compare the sensitivities after a hold of 0.1 s with differences of the scheme's own steps.
    fn are_slopes(model: &Dynamics, start: [f64; 4], substeps: usize, scheme: &'static Scheme) {
        let active: Vec<usize> = (0..model.parameters.len()).collect();
        let tangent = Tangent::new(model, &active, Local::State);
        let states = model.states();
        let (time, tau) = ([0.0], HELD.map(|tau| vec![tau]));
        let commands = Commands::new(model, &time, &tau);
        let end = |values: &[f64], start: &[f64]| {
            let mut simulator = Simulator::<1>::new(Point::new(model, values), scheme);
            simulator.place(start);
            let (held, from) = (HELD.map(|tau| Row([tau])), Row([0.2]));
            simulator.advance(&Hold::lasting([&commands], &held, from, 0.1, substeps));
            simulator.state.clone()
        };
        let values = model.values();
        let mut stepper = TangentStepper::new(&tangent, &values, scheme);
        let internal = internal_start(model);
        stepper.start(&start.map(Row::splat), &internal);
        let (held, from) = (HELD.map(Row::splat), Row::splat(0.2));
        let hold = Hold::lasting([&commands; LANES], &held, from, 0.1, substeps);
        stepper.advance(&hold);
        for (row, state) in end(&values, &start).iter().enumerate() {
            let off = (stepper.now[row][3] - state[0]).abs();
            assert!(off < 1e-12, "{}, state {row}: {off}", scheme.name);
        }
        for column in 0..tangent.columns() {
            let moved = |by: f64| {
                let (mut values, mut start) = (values.clone(), start);
                match values.get_mut(column) {
                    Some(value) => *value += by,
                    None => start[column - active.len()] += by,
                }
                end(&values, &start)
            };
            // Five points: contacts are stiff, and their curvature shows in three.
            let [far, near] = [2e-6, 1e-6].map(|by| [moved(by), moved(-by)]);
            for row in 0..states {
                let [far, near] =
                    [&far, &near].map(|[after, before]| after[row][0] - before[row][0]);
                let wanted = (8.0 * near - far) / 12e-6;
                let found = stepper.now[states * (1 + column) + row][3];
                assert!(
                    (found - wanted).abs() < 1e-8 * wanted.abs().max(1.0),
                    "{}, column {column}, state {row}: {found} {wanted}",
                    scheme.name
                );
            }
        }
    }

    /// Internal states as before a log, which are linear in the parameters.
    fn internal_start(model: &Dynamics) -> InternalStart<LANES> {
        let Some(internal) = &model.internal else {
            return InternalStart::default();
        };
        let values = model.values();
        let slope = |pair: &Dependence| {
            let mut moved = values.clone();
            moved[pair.parameter] += 1.0;
            let [before, after] =
                [&values, &moved].map(|values| model.internal_starts(values)[pair.state]);
            (*pair, Row::splat(after - before))
        };
        InternalStart {
            slopes: internal.pairs.iter().map(slope).collect(),
            values: model
                .internal_starts(&values)
                .into_iter()
                .map(Row::splat)
                .collect(),
        }
    }

    #[test]
    fn sensitivities_are_the_slopes_of_every_schemes_steps() {
        let acrobot = Library::built_in().model("acrobot").unwrap();
        let model = acrobot.with_smoothing_velocities(vec![0.0; 2]).dynamics();
        for scheme in SCHEMES {
            are_slopes(&model, [0.7, -0.4, 1.5, -2.0], 3, scheme);
        }
    }

    #[test]
    fn sensitivities_of_internal_states_are_the_slopes_of_every_schemes_steps() {
        let on = [0, 1].map(|joint| bristles(Joint::at(joint)));
        let acrobot = Library::built_in().model("acrobot").unwrap();
        let model = acrobot.with_effects(on.to_vec()).dynamics();
        assert_eq!(model.states(), 8);
        for scheme in SCHEMES {
            are_slopes(&model, [0.7, -0.4, 1.5, -2.0], 20, scheme);
        }
    }

    #[test]
    fn sensitivities_of_elastic_joints_are_the_slopes_of_every_schemes_steps() {
        let acrobot = Library::built_in().model("acrobot").unwrap();
        for sides in [[0.0, 1.0], [1.0, 0.0]] {
            let model = acrobot.with_effects(vec![
                viscous(Joint::at(0)),
                elastic(Joint::at(0), sides),
                elastic(Joint::at(1), sides),
            ]);
            let model = model.dynamics();
            assert_eq!(model.states(), 8);
            for scheme in SCHEMES {
                are_slopes(&model, [0.7, -0.4, 1.5, -2.0], 20, scheme);
            }
        }
    }

    /// The second motor meets its link within the time that is compared.
    #[test]
    fn sensitivities_of_joints_with_play_are_the_slopes_of_every_schemes_steps() {
        let acrobot = Library::built_in().model("acrobot").unwrap();
        for sides in [[0.0, 1.0], [1.0, 0.0]] {
            let effects = [viscous(Joint::at(0)), loose(Joint::at(1), sides)];
            let model = acrobot.with_effects(effects.to_vec()).dynamics();
            for scheme in SCHEMES {
                are_slopes(&model, [0.7, -0.4, 1.5, -2.0], 20, scheme);
            }
        }
    }

    /// Both joints come to rest within the width over which their friction reverses, in steps that are just short
    /// enough: the decay rates are about 270/s and 600/s.
    #[test]
    fn sensitivities_of_joints_that_come_to_rest_are_slopes_while_steps_are_stable() {
        let library = Library::built_in();
        let friction = library.effect("coulomb_friction").unwrap();
        let on = |joint: usize| FittedEffect::absent(friction, Joint::at(joint));
        let acrobot = library.model("acrobot").unwrap();
        let model = acrobot.with_effects(vec![on(0), on(1)]);
        let model = model.with_smoothing_velocities(vec![0.02; 2]).dynamics();
        let values = [acrobot.values(), vec![6.0, 6.0]].concat();
        let model = model.with_values(values);
        are_slopes(&model, [0.3, -0.2, 0.05, -0.06], 50, RK4);
    }

    /// A joint held by more friction than the torque that drives it hardly moves; the steps are too long to follow how
    /// fast it comes to rest.
    #[test]
    fn sensitivities_of_a_joint_that_sticks_stay_small() {
        let library = Library::built_in();
        let friction =
            FittedEffect::absent(library.effect("coulomb_friction").unwrap(), Joint::at(0));
        let pendulum = library.model("pendulum").unwrap();
        let model = pendulum.with_effects(vec![friction]);
        let model = model.with_smoothing_velocities(vec![2e-3]).dynamics();
        let mut values = model.values();
        *values.last_mut().unwrap() = 4.0;
        let tangent = Tangent::new(&model, &[2], Local::State);
        let mut stepper = TangentStepper::new(&tangent, &values, RK4);
        stepper.start(&[0.0, 0.5].map(Row::splat), &InternalStart::default());
        let (time, tau) = ([0.0], [vec![1.0]]);
        let commands = Commands::new(&model, &time, &tau);
        let (held, from) = ([Row::splat(1.0)], Row::splat(0.0));
        stepper.advance(&Hold::lasting([&commands; LANES], &held, from, 0.5, 250));
        for column in 0..tangent.columns() {
            let [angle, velocity] = [0, 1].map(|row| stepper.now[2 * (1 + column) + row][0]);
            assert!(
                angle.abs() < 1.1 && velocity.abs() < 0.1,
                "{column}: {angle} {velocity}"
            );
        }
    }
}
