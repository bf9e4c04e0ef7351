use crate::expr::{Graph, Program, Tape};
use crate::lanes::Row;
use crate::model::{Dynamics, StepTorque};

/// Lanes of the identification: one AVX-512 register, two AVX2 registers of f64.
pub(super) const LANES: usize = 8;
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
/// Outputs: accelerations (n), then for each joint a row of derivatives by `q`, `qd`, active
/// parameters and, if they are free, forces. The identification is for physics: dq/dt = qd. Further inputs
/// behind the model's own are the derivatives of the torques by the parameters of the model's filters.
pub(super) struct Tangent {
    pub program: Program,
    /// Where sensors show other angles than the rig's own: those (n), then for each joint their derivatives by `q`
    /// and `qd`, then for each joint those by active parameters. The inputs are the model's.
    pub reading: Option<Program>,
    pub joints: usize,
    /// Indices into the model's parameters.
    pub active: Vec<usize>,
    pub local: Local,
}

impl Tangent {
    pub fn new(dynamics: &Dynamics, active: &[usize], local: Local) -> Self {
        let n = dynamics.joints;
        let mut graph = Graph::new();
        let inputs: Vec<_> = dynamics
            .program
            .inputs()
            .iter()
            .map(|name| graph.input(name))
            .collect();
        let outputs = graph.append(&dynamics.program, &inputs);
        let accelerations = &outputs[n..];
        let mut wrt = inputs[..2 * n].to_vec();
        wrt.extend(active.iter().map(|&k| inputs[3 * n + 1 + k]));
        if local == Local::StateAndForce {
            wrt.extend(&inputs[2 * n..3 * n]);
        }
        let mut jacobian = graph.jacobian(accelerations, &wrt);
        for filter in &dynamics.filters {
            let slope = graph.input(&format!("slope of {}", filter.parameter));
            let Some(column) = active.iter().position(|&k| k == filter.parameter) else {
                continue;
            };
            let by_torque = graph.jacobian(accelerations, &[inputs[2 * n + filter.joint]]);
            for (row, by_torque) in jacobian.iter_mut().zip(by_torque) {
                row[2 * n + column] = graph.mul(by_torque[0], slope);
            }
        }
        let all: Vec<_> = accelerations
            .iter()
            .copied()
            .chain(jacobian.into_iter().flatten())
            .collect();
        Self {
            program: graph.finish(&all),
            reading: reading(dynamics, active),
            joints: n,
            active: active.to_vec(),
            local,
        }
    }

    /// Columns of the sensitivities: shared parameters, then what is local to a window.
    pub fn columns(&self) -> usize {
        self.active.len() + self.locals()
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
    /// `[row]` of states, then `[row * columns + column]` of sensitivities.
    pub now: Vec<Lane>,
    inner: Vec<Lane>,
    slope: Vec<Lane>,
    sum: Vec<Lane>,
    reading: Option<Tape<'t, f64, LANES>>,
    /// Angles shown, then their sensitivities, laid out as in `now`.
    shown: Vec<Lane>,
}

/// The classical Runge-Kutta method: time of the stage, reach of the next stage, weight in the sum.
const STAGES: [(f64, f64, f64); 4] = [
    (0.0, 0.5, 1.0 / 6.0),
    (0.5, 0.5, 1.0 / 3.0),
    (0.5, 1.0, 1.0 / 3.0),
    (1.0, 0.0, 1.0 / 6.0),
];

impl<'t> Flow<'t> {
    pub fn new(tangent: &'t Tangent, values: &[f64]) -> Self {
        let n = tangent.joints;
        let mut tape = tangent.program.tape();
        for (slot, value) in tape.inputs()[3 * n + 1..].iter_mut().zip(values) {
            *slot = Row::splat(*value);
        }
        let mut reading = tangent.reading.as_ref().map(Program::tape);
        if let Some(reading) = &mut reading {
            for (slot, value) in reading.inputs()[3 * n + 1..].iter_mut().zip(values) {
                *slot = Row::splat(*value);
            }
        }
        let size = 2 * n * (1 + tangent.columns());
        Self {
            tangent,
            tape,
            now: vec![Row::splat(0.0); size],
            inner: vec![Row::splat(0.0); size],
            slope: vec![Row::splat(0.0); size],
            sum: vec![Row::splat(0.0); size],
            reading,
            shown: vec![Row::splat(0.0); size / 2],
        }
    }

    /// Let a parameter have another value in one lane.
    pub fn set_in_lane(&mut self, parameter: usize, lane: usize, value: f64) {
        let first = 3 * self.tangent.joints + 1;
        self.tape.inputs()[first + parameter][lane] = value;
        if let Some(reading) = &mut self.reading {
            reading.inputs()[first + parameter][lane] = value;
        }
    }

    /// The angles that the sensors show and their sensitivities (`[joint * columns + column]`), when the torque
    /// until now was `tau`.
    pub fn shown(&mut self, tau: impl FnOnce() -> Vec<Lane>, time: Lane) -> (&[Lane], &[Lane]) {
        let (n, columns) = (self.tangent.joints, self.tangent.columns());
        let Some(reading) = &mut self.reading else {
            return (&self.now[..n], &self.now[2 * n..][..n * columns]);
        };
        let inputs = reading.inputs();
        inputs[..2 * n].copy_from_slice(&self.now[..2 * n]);
        inputs[2 * n..3 * n].copy_from_slice(&tau());
        inputs[3 * n] = time;
        reading.run();
        let shared = self.tangent.active.len();
        for joint in 0..n {
            self.shown[joint] = *reading.output(joint);
            for column in 0..columns {
                let direct = n + 2 * n * n + joint * shared + column;
                let mut sum = if column < shared {
                    *reading.output(direct)
                } else {
                    Row::splat(0.0)
                };
                for state in 0..2 * n {
                    let slope = reading.output(n + joint * 2 * n + state);
                    let own = &self.now[2 * n + state * columns + column];
                    for lane in 0..LANES {
                        sum[lane] += slope[lane] * own[lane];
                    }
                }
                self.shown[n + joint * columns + column] = sum;
            }
        }
        self.shown.split_at(n)
    }

    /// Start at these states; only the columns of the initial state are sensitive to them.
    pub fn start(&mut self, states: &[Lane]) {
        let (n, columns) = (self.tangent.joints, self.tangent.columns());
        self.now.fill(Row::splat(0.0));
        self.now[..2 * n].copy_from_slice(&states[..2 * n]);
        for row in 0..2 * n {
            self.now[2 * n + row * columns + self.tangent.active.len() + row] = Row::splat(1.0);
        }
    }

    /// As [`Rollout::advance`](crate::model::Rollout::advance), with the torque's derivatives by the parameters
    /// of filters.
    pub fn advance(&mut self, torque: &StepTorque<LANES>, time: Lane, dt: Lane, substeps: usize) {
        let n = self.tangent.joints;
        #[allow(clippy::cast_precision_loss)] // few substeps
        let h = Row(dt.map(|dt| dt / substeps as f64));
        let mut now = time;
        for part in 0..substeps {
            let (tau, slopes) = torque.part(n, part);
            let inputs = self.tape.inputs();
            inputs[2 * n..3 * n].copy_from_slice(tau);
            let own = inputs.len() - slopes.len();
            inputs[own..].copy_from_slice(slopes);
            self.step(now, h);
            now = Row(std::array::from_fn(|lane| now[lane] + h[lane]));
        }
    }

    fn step(&mut self, time: Lane, h: Lane) {
        self.inner.copy_from_slice(&self.now);
        self.sum.copy_from_slice(&self.now);
        for (part, reach, weight) in STAGES {
            let stage_time = Row(std::array::from_fn(|lane| time[lane] + part * h[lane]));
            self.derivative(stage_time);
            for (((sum, inner), slope), now) in self
                .sum
                .iter_mut()
                .zip(&mut self.inner)
                .zip(&self.slope)
                .zip(&self.now)
            {
                for lane in 0..LANES {
                    sum[lane] += weight * h[lane] * slope[lane];
                    inner[lane] = now[lane] + reach * h[lane] * slope[lane];
                }
            }
        }
        std::mem::swap(&mut self.now, &mut self.sum);
    }

    fn derivative(&mut self, time: Lane) {
        let n = self.tangent.joints;
        let inputs = self.tape.inputs();
        inputs[..2 * n].copy_from_slice(&self.inner[..2 * n]);
        inputs[3 * n] = time;
        self.tape.run();
        let (positions, velocities) = (0..n, n..2 * n);
        for row in positions {
            self.slope[row] = self.inner[n + row];
        }
        for row in velocities {
            self.slope[row] = *self.tape.output(row - n);
        }
        self.sensitivity_slopes();
    }

    fn sensitivity_slopes(&mut self) {
        let (n, columns) = (self.tangent.joints, self.tangent.columns());
        let shared = self.tangent.active.len();
        let inner = &self.inner[2 * n..];
        let (angles, velocities) = self.slope[2 * n..].split_at_mut(n * columns);
        angles.copy_from_slice(&inner[n * columns..]);
        for joint in 0..n {
            // A row of derivatives: 2n states, then parameters, then forces; as many as there are columns.
            let row = n + joint * columns;
            for column in 0..columns {
                let direct = match column {
                    parameter if parameter < shared => Some(2 * n + parameter),
                    force if force >= shared + 2 * n => Some(force),
                    _ => None,
                };
                let mut out = direct.map_or(Row::splat(0.0), |at| *self.tape.output(row + at));
                for state in 0..2 * n {
                    let slope = self.tape.output(row + state);
                    let inner = &inner[state * columns + column];
                    for lane in 0..LANES {
                        out[lane] += slope[lane] * inner[lane];
                    }
                }
                velocities[joint * columns + column] = out;
            }
        }
    }
}
