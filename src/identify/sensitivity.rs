use crate::expr::{Graph, Node, Program, Tape};
use crate::lanes::{Row, Simd, WithSimd};
use crate::model::{Dynamics, StepTorque};

/// Lanes of the identification: one AVX-512 register, two AVX2 registers of f64.
pub(super) const LANES: usize = 16;
pub(super) type Lane = Row<f64, LANES>;

/// What is free in each window, besides the parameters that all windows share.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Local {
    /// The state at the window's start.
    State,
    /// That, and a constant generalised force a joint: what the model lacks there.
    StateAndForce,
}

/// The program of a model's accelerations with their derivatives by states, shared parameters and forces.
///
/// Outputs: accelerations (n), for each joint their derivatives by `q` and `qd`, then for each active parameter and,
/// if they are free, each force their derivatives by it. The identification is for physics: dq/dt = qd. Inputs are the
/// model's; before its parameters stand the derivatives of the torques by the parameters of its filters.
pub(super) struct Tangent {
    pub program: Program,
    /// Where sensors show other angles than the rig's own: those (n), then for each joint their derivatives by `q`
    /// and `qd`, then for each joint those by active parameters. The inputs are the model's.
    pub reading: Option<Program>,
    pub joints: usize,
    /// Number of the model's filters.
    filters: usize,
    /// Indices into the model's parameters.
    pub active: Vec<usize>,
    pub local: Local,
}

impl Tangent {
    pub fn new(dynamics: &Dynamics, active: &[usize], local: Local) -> Self {
        let n = dynamics.joints;
        let mut graph = Graph::new();
        let (moving, held) = dynamics.program.inputs().split_at(3 * n + 1);
        let mut inputs: Vec<Node> = moving.iter().map(|name| graph.input(name)).collect();
        let slopes = (dynamics.filters.iter())
            .map(|filter| graph.input(&format!("slope of {}", filter.parameter)))
            .collect::<Vec<_>>();
        inputs.extend(held.iter().map(|name| graph.input(name)));
        let outputs = graph.append(&dynamics.program, &inputs);
        let accelerations = &outputs[n..];
        let mut wrt = inputs[..2 * n].to_vec();
        wrt.extend(active.iter().map(|&k| inputs[3 * n + 1 + k]));
        if local == Local::StateAndForce {
            wrt.extend(&inputs[2 * n..3 * n]);
        }
        let mut jacobian = graph.jacobian(accelerations, &wrt);
        for (filter, slope) in dynamics.filters.iter().zip(slopes) {
            let Some(column) = active.iter().position(|&k| k == filter.parameter) else {
                continue;
            };
            let by_torque = graph.jacobian(accelerations, &[inputs[2 * n + filter.joint.index()]]);
            for (row, by_torque) in jacobian.iter_mut().zip(by_torque) {
                row[2 * n + column] = graph.mul(by_torque[0], slope);
            }
        }
        let by_states = jacobian.iter().flat_map(|row| &row[..2 * n]);
        let others = (2 * n..wrt.len()).flat_map(|k| jacobian.iter().map(move |row| &row[k]));
        let all: Vec<Node> = (accelerations.iter().chain(by_states).chain(others))
            .copied()
            .collect();
        Self {
            program: graph.finish(&all),
            reading: reading(dynamics, active),
            joints: n,
            filters: dynamics.filters.len(),
            active: active.to_vec(),
            local,
        }
    }

    /// Columns of the sensitivities: shared parameters, then what is local to a window.
    pub fn columns(&self) -> usize {
        self.active.len() + self.locals()
    }

    /// The output that holds the direct derivatives by a column's value, where there are any; the first column is
    /// the state itself, whose slopes are the accelerations.
    #[inline(always)]
    fn direct(&self, column: usize) -> Option<usize> {
        let (n, shared) = (self.joints, self.active.len());
        let others = n + 2 * n * n;
        match column.checked_sub(1) {
            None => Some(0),
            Some(parameter) if parameter < shared => Some(others + n * parameter),
            Some(state) if state < shared + 2 * n => None,
            Some(force) => Some(others + n * (force - 2 * n)),
        }
    }

    fn first_parameter(&self) -> usize {
        3 * self.joints + 1 + self.filters
    }

    /// Free values of one window.
    pub fn locals(&self) -> usize {
        match self.local {
            Local::State => 2 * self.joints,
            Local::StateAndForce => 3 * self.joints,
        }
    }
}

/// See [`Tangent::reading`].
fn reading(dynamics: &Dynamics, active: &[usize]) -> Option<Program> {
    let n = dynamics.joints;
    let mut graph = Graph::new();
    let names = dynamics.program.inputs();
    let inputs: Vec<_> = names.iter().map(|name| graph.input(name)).collect();
    let shown = graph.append(dynamics.reading.as_ref()?, &inputs);
    let parameters: Vec<_> = active.iter().map(|&k| inputs[3 * n + 1 + k]).collect();
    let by_state = graph.jacobian(&shown, &inputs[..2 * n]).concat();
    let by_parameter = graph.jacobian(&shown, &parameters).concat();
    Some(graph.finish(&[shown, by_state, by_parameter].concat()))
}

/// Integrates states and their sensitivities together, by the classical Runge-Kutta method of order 4.
///
/// The sensitivity of column c obeys dS/dt = (df/dx) S + df/dc; rows are angles, then velocities.
pub(super) struct Flow<'t> {
    tangent: &'t Tangent,
    tape: Tape<'t, f64, LANES>,
    /// States, then for each column their sensitivities: 2n rows each.
    now: Vec<Lane>,
    inner: Vec<Lane>,
    next: Vec<Lane>,
    sum: Vec<Lane>,
    /// Derivatives of the accelerations by states, `[joint * 2n + state]`.
    by_state: Vec<Lane>,
    reading: Option<Tape<'t, f64, LANES>>,
    /// Angles shown, then `[joint * columns + column]` their sensitivities.
    shown: Vec<Lane>,
}

/// The classical Runge-Kutta method: time of the stage, weight in the sum, reach of the next stage.
const STAGES: [(f64, f64, f64); 4] = [
    (0.0, 1.0 / 6.0, 0.5),
    (0.5, 1.0 / 3.0, 0.5),
    (0.5, 1.0 / 3.0, 1.0),
    (1.0, 1.0 / 6.0, 0.0),
];

impl<'t> Flow<'t> {
    pub fn new(tangent: &'t Tangent, values: &[f64]) -> Self {
        let n = tangent.joints;
        let first = tangent.first_parameter();
        let mut tape = tangent.program.tape_with_held(first);
        for (slot, value) in tape.inputs()[first..].iter_mut().zip(values) {
            *slot = Row::splat(*value);
        }
        let mut reading = tangent
            .reading
            .as_ref()
            .map(|reading| reading.tape_with_held(3 * n + 1));
        if let Some(reading) = &mut reading {
            for (slot, value) in reading.inputs()[3 * n + 1..].iter_mut().zip(values) {
                *slot = Row::splat(*value);
            }
        }
        let rows = |count: usize| vec![Row::splat(0.0); count];
        let size = 2 * n * (1 + tangent.columns());
        Self {
            tangent,
            tape,
            now: rows(size),
            inner: rows(size),
            next: rows(size),
            sum: rows(size),
            by_state: rows(2 * n * n),
            reading,
            shown: rows(size / 2),
        }
    }

    /// Let a parameter have another value in one lane.
    pub fn set_in_lane(&mut self, parameter: usize, lane: usize, value: f64) {
        self.tape.inputs()[self.tangent.first_parameter() + parameter][lane] = value;
        if let Some(reading) = &mut self.reading {
            reading.inputs()[3 * self.tangent.joints + 1 + parameter][lane] = value;
        }
    }

    /// The angles that the sensors show and their sensitivities (`[joint * columns + column]`), when the torque
    /// until now was `tau`.
    pub fn shown(&mut self, tau: impl FnOnce() -> Vec<Lane>, time: Lane) -> (&[Lane], &[Lane]) {
        let (n, columns) = (self.tangent.joints, self.tangent.columns());
        let (state, sensitivities) = self.now.split_at(2 * n);
        let (angles, slopes) = self.shown.split_at_mut(n);
        let Some(reading) = &mut self.reading else {
            angles.copy_from_slice(&state[..n]);
            for (joint, slopes) in slopes.chunks_exact_mut(columns).enumerate() {
                for (slope, column) in slopes.iter_mut().zip(sensitivities.chunks_exact(2 * n)) {
                    *slope = column[joint];
                }
            }
            return (angles, slopes);
        };
        let inputs = reading.moving();
        inputs[..2 * n].copy_from_slice(state);
        inputs[2 * n..3 * n].copy_from_slice(&tau());
        inputs[3 * n] = time;
        reading.run();
        let shared = self.tangent.active.len();
        for (joint, slopes) in slopes.chunks_exact_mut(columns).enumerate() {
            angles[joint] = *reading.output(joint);
            for (column, slope) in slopes.iter_mut().enumerate() {
                let direct = n + 2 * n * n + joint * shared + column;
                *slope = if column < shared {
                    *reading.output(direct)
                } else {
                    Row::splat(0.0)
                };
                for (state, own) in sensitivities[2 * n * column..][..2 * n].iter().enumerate() {
                    let by_state = reading.output(n + joint * 2 * n + state);
                    for lane in 0..LANES {
                        slope[lane] += by_state[lane] * own[lane];
                    }
                }
            }
        }
        (angles, slopes)
    }

    /// Start at these states; only the columns of the initial state are sensitive to them.
    pub fn start(&mut self, states: &[Lane]) {
        let (n, shared) = (self.tangent.joints, self.tangent.active.len());
        self.now.fill(Row::splat(0.0));
        self.now[..2 * n].copy_from_slice(&states[..2 * n]);
        for row in 0..2 * n {
            self.now[2 * n * (1 + shared + row) + row] = Row::splat(1.0);
        }
    }

    /// As [`Rollout::advance`](crate::model::Rollout::advance), with the torque's derivatives by the parameters
    /// of filters.
    pub fn advance(&mut self, torque: &StepTorque<LANES>, time: Lane, dt: Lane, substeps: usize) {
        Lane::dispatch(Advance {
            flow: self,
            torque,
            time,
            dt,
            substeps,
        });
    }

    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, time: &Lane, h: &Lane) {
        let n = self.tangent.joints;
        for (k, stage) in STAGES.into_iter().enumerate() {
            let inner = if k == 0 { &self.now } else { &self.inner };
            let inputs = self.tape.moving();
            inputs[..2 * n].copy_from_slice(&inner[..2 * n]);
            for part in 0..Lane::parts::<S>() {
                let h = h.get(simd, part);
                inputs[3 * n].set(part, h.mul_add(h.like(stage.0), time.get(simd, part)));
            }
            self.tape.run_on(simd);
            for (k, slope) in self.by_state.iter_mut().enumerate() {
                *slope = *self.tape.output(n + k);
            }
            self.stage(simd, h, k == 0, stage);
            std::mem::swap(&mut self.inner, &mut self.next);
        }
        std::mem::swap(&mut self.now, &mut self.sum);
    }

    /// Add a stage's slopes to the sums, and find where they lead to.
    #[inline(always)]
    fn stage<S: Simd>(&mut self, simd: S, h: &Lane, is_first: bool, stage: (f64, f64, f64)) {
        // Numbers that the compiler knows: loops over so few rows vanish.
        match self.tangent.joints {
            1 => self.stage_of(simd, 1, h, is_first, stage),
            2 => self.stage_of(simd, 2, h, is_first, stage),
            n => self.stage_of(simd, n, h, is_first, stage),
        }
    }

    #[inline(always)]
    fn stage_of<S: Simd>(
        &mut self,
        simd: S,
        n: usize,
        h: &Lane,
        is_first: bool,
        (_, weight, reach): (f64, f64, f64),
    ) {
        let rows = 2 * n;
        let inner = if is_first { &self.now } else { &self.inner };
        let columns = (self.now.chunks_exact(rows))
            .zip(inner.chunks_exact(rows))
            .zip(self.next.chunks_exact_mut(rows))
            .zip(self.sum.chunks_exact_mut(rows));
        let by_state = &self.by_state[..n * rows];
        for (column, (((now, inner), next), sum)) in columns.enumerate() {
            let direct = self.tangent.direct(column);
            for part in 0..Lane::parts::<S>() {
                let h = h.get(simd, part);
                let (weighed, reached) = (h * h.like(weight), h * h.like(reach));
                for row in 0..rows {
                    let slope = if row < n {
                        inner[n + row].get(simd, part)
                    } else {
                        let mut slope = match direct {
                            Some(first) => self.tape.output(first + row - n).get(simd, part),
                            None => h.like(0.0),
                        };
                        if column > 0 {
                            for state in 0..rows {
                                let by_state = by_state[(row - n) * rows + state].get(simd, part);
                                slope = by_state.mul_add(inner[state].get(simd, part), slope);
                            }
                        }
                        slope
                    };
                    let now = now[row].get(simd, part);
                    let before = if is_first {
                        now
                    } else {
                        sum[row].get(simd, part)
                    };
                    sum[row].set(part, slope.mul_add(weighed, before));
                    next[row].set(part, slope.mul_add(reached, now));
                }
            }
        }
    }
}

struct Advance<'a, 't> {
    flow: &'a mut Flow<'t>,
    torque: &'a StepTorque<LANES>,
    time: Lane,
    dt: Lane,
    substeps: usize,
}

impl WithSimd for Advance<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let n = self.flow.tangent.joints;
        #[allow(clippy::cast_precision_loss)] // few substeps
        let h = Row(self.dt.map(|dt| dt / self.substeps as f64));
        for part in 0..self.substeps {
            let (tau, slopes) = self.torque.part(n, part);
            let inputs = self.flow.tape.moving();
            inputs[2 * n..3 * n].copy_from_slice(tau);
            inputs[3 * n + 1..].copy_from_slice(slopes);
            self.flow.step(simd, &self.time, &h);
            for lane in 0..LANES {
                self.time[lane] += h[lane];
            }
        }
    }
}
