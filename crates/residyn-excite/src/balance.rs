//! The torques of a motion as programs: what drives it, by how much these torques change with each parameter, and by how
//! much they differ under each alternative, with the gradient of all of these with respect to the motion.

use residyn_core::expr::{Graph, Node, Program, Tape};
use residyn_core::lanes::Row;
use residyn_core::model::{CommandFilter, Dynamics, Model};

use crate::error::ExciteError;
use crate::fourier::{DERIVATIVES, Motion};

/// Rows that are evaluated side by side.
const LANES: usize = 16;
type Lane = Row<f64, LANES>;

/// Steps of Newton's method for a command on which the torque does not depend linearly.
const NEWTON_STEPS: usize = 4;

/// The equations of a model as a balance of torques: zero where motion and command belong together.
pub struct Equation {
    /// Inputs: q, qd, internal states, commands, t, qdd, then the parameters. Outputs: for each joint, in N m (or N), the
    /// torque that the motion needs beyond the one that acts, expressed as the torque that is commanded, or that the
    /// drive's law asks for.
    residual: Program,
    pub dynamics: Dynamics,
}

impl Equation {
    /// That of a model with mass matrix, or of one with accelerations, whose balance is the difference of accelerations
    /// over the joints' mobility.
    ///
    /// # Errors
    /// A model that reads measured columns of logs.
    pub fn of(model: &Model) -> Result<Self, ExciteError> {
        model.runs_without_logs("a designed motion")?;
        Ok(match model.torque_balance() {
            Some(dynamics) => Self {
                residual: dynamics.program.clone(),
                dynamics,
            },
            None => Self {
                residual: of_accelerations(model),
                dynamics: model.dynamics(),
            },
        })
    }

    fn joints(&self) -> usize {
        self.dynamics.joints
    }

    /// The internal states of a rig at rest before it moves.
    pub fn internal_starts(&self) -> Vec<f64> {
        self.dynamics.internal_starts(&self.dynamics.values())
    }

    /// The balance at one row: q, qd and qdd, internal states, commands and the time.
    pub fn at(
        &self,
        [q, qd, qdd]: [&[f64]; 3],
        internal: &[f64],
        command: &[f64],
        time_s: f64,
        values: &[f64],
    ) -> Vec<f64> {
        let inputs = [q, qd, internal, command, &[time_s], qdd, values].concat();
        self.residual.eval(&inputs)
    }

    /// A program of the balance's inputs in a graph; internal states and parameters are constant.
    fn append(
        &self,
        program: &Program,
        graph: &mut Graph,
        motion: &MotionNodes,
        command: &[Node],
    ) -> Vec<Node> {
        let mut numbers = |values: Vec<f64>| -> Vec<Node> {
            let values = values.into_iter();
            values.map(|value| graph.constant(value)).collect()
        };
        let internal = numbers(self.internal_starts());
        let values = numbers(self.dynamics.values());
        let MotionNodes {
            q, qd, qdd, time, ..
        } = motion;
        let inputs = [q, qd, &internal, command, &[*time], qdd, &values].concat();
        graph.append(program, &inputs)
    }

    /// What `of` makes of the balance's outputs and inputs, as a program of these inputs: derivatives are taken here, where
    /// every input is a node of its own.
    fn derived(&self, of: impl FnOnce(&mut Graph, &[Node], &[Node]) -> Vec<Node>) -> Program {
        let mut graph = Graph::new();
        let names = self.residual.inputs();
        let inputs: Vec<Node> = names.iter().map(|name| graph.input(name)).collect();
        let outputs = graph.append(&self.residual, &inputs);
        let derived = of(&mut graph, &outputs, &inputs);
        graph.finish(&derived)
    }

    /// The derivative of each joint's balance with respect to its own command.
    fn by_own_command(&self) -> Program {
        let driving = self.dynamics.layout().driving();
        self.derived(|graph, outputs, inputs| own_slopes(graph, outputs, &inputs[driving]))
    }

    /// Whether each joint's balance depends linearly on its own command, and on no other.
    fn is_linear(&self) -> bool {
        let driving = self.dynamics.layout().driving();
        let mut is_coupled = false;
        let slopes = self.derived(|graph, outputs, inputs| {
            let jacobian = graph.jacobian(outputs, &inputs[driving.clone()]);
            let own = |joint: usize| jacobian[joint][joint];
            let others = (0..outputs.len()).flat_map(|i| (0..outputs.len()).map(move |j| (i, j)));
            is_coupled = others
                .filter(|(i, j)| i != j)
                .any(|(i, j)| !graph.is_zero(jacobian[i][j]));
            (0..outputs.len()).map(own).collect()
        });
        !is_coupled && !slopes.inputs_read()[driving].contains(&true)
    }
}

/// The balance of a model that gives accelerations: (qdd - a(tau)) / (da/dtau).
fn of_accelerations(model: &Model) -> Program {
    let plain = model.without_drive().dynamics();
    let (n, layout) = (plain.joints, plain.layout());
    let mut graph = Graph::new();
    let mut inputs = |stem: &str, count: usize| -> Vec<Node> {
        (1..=count)
            .map(|k| graph.input(&format!("{stem}{k}")))
            .collect()
    };
    let (q, qd) = (inputs("q", n), inputs("qd", n));
    let internal = inputs("state", layout.internal().len());
    let command = inputs("cmd", n);
    let time = inputs("t", 1);
    let qdd = inputs("qdd", n);
    let values = inputs("p", plain.parameters.len());
    let tau = match model.drive_program() {
        Some(law) => {
            let declared = &values[..model.parameters.len()];
            graph.append(&law, &[&q, &qd, &command, &time, declared].concat())
        }
        None => command.clone(),
    };
    let mut all = [q, qd, internal.clone(), tau.clone(), time].concat();
    if !internal.is_empty() {
        all.extend(&internal);
        all.push(graph.constant(residyn_core::sim::FIT_S));
    }
    all.extend(&values);
    let accelerations = graph.append(&plain.program, &all)[n..2 * n].to_vec();
    let mobility = graph.jacobian(&accelerations, &tau);
    let missing: Vec<Node> = (qdd.iter().zip(&accelerations))
        .map(|(needed, found)| graph.sub(*needed, *found))
        .collect();
    let torques = graph.solve_spd(&mobility, &missing);
    graph.finish(&torques)
}

/// Inputs for each joint besides the motion, on which no output depends: see [`MotionNodes::rates`].
const SEEDS: usize = 2;

/// The nodes of a motion, the first inputs of each program here.
struct MotionNodes {
    q: Vec<Node>,
    qd: Vec<Node>,
    qdd: Vec<Node>,
    jerk: Vec<Node>,
    time: Node,
    seeds: Vec<Node>,
}

impl MotionNodes {
    fn inputs(graph: &mut Graph, joints: usize) -> Self {
        let mut inputs = |stem: &str| -> Vec<Node> {
            (1..=joints)
                .map(|k| graph.input(&format!("{stem}{k}")))
                .collect()
        };
        Self {
            q: inputs("q"),
            qd: inputs("qd"),
            qdd: inputs("qdd"),
            jerk: inputs("qddd"),
            time: graph.input("t"),
            seeds: (0..SEEDS * joints)
                .map(|k| graph.input(&format!("seed{k}")))
                .collect(),
        }
    }

    fn all(&self) -> Vec<Node> {
        [&self.q[..], &self.qd, &self.qdd, &self.jerk].concat()
    }

    /// The rates of two values per joint along the motion: the directional derivative by two reverse passes, the second
    /// through the first, which is linear in its seeds.
    fn rates(&self, graph: &mut Graph, of: &[Node]) -> Vec<Node> {
        let states = [&self.q[..], &self.qd, &self.qdd].concat();
        let speeds = [&self.qd[..], &self.qdd, &self.jerk].concat();
        let slopes = graph.gradient(of, &self.seeds, &states);
        let along = graph.dot(&slopes, &speeds);
        let one = graph.constant(1.0);
        graph.gradient(&[along], &[one], &self.seeds)
    }
}

/// What drives each row of a motion: `[row * joints + joint]`.
#[derive(Debug, Clone, Default)]
pub struct Drive {
    /// Torque, or command of the drive.
    pub command: Vec<f64>,
    /// Torque that is commanded, or that the drive's law asks for, N m (or N).
    pub torque: Vec<f64>,
    /// Rates of the two, per s.
    pub command_rate: Vec<f64>,
    pub torque_rate: Vec<f64>,
}

/// A model's torque balance along motions, for some free parameters and alternatives.
pub struct Balance {
    pub joints: usize,
    /// Joint and column of each slope that is not zero everywhere.
    pub entries: Vec<(usize, usize)>,
    /// Number of alternatives.
    pub alternatives: usize,
    drive: Program,
    /// What drives, the slopes, then the balances of the alternatives.
    forward: Program,
    /// Inputs: the motion and a weight for each output of `forward`. Outputs: the weighted sum's gradient with respect to
    /// the motion.
    adjoint: Program,
}

/// The outputs of [`Balance::forward`].
pub struct Along {
    pub drive: Drive,
    /// `[row * entries + entry]`, torque per unit of the parameter.
    pub slopes: Vec<f64>,
    /// `[(row * alternatives + alternative) * joints + joint]`, N m (or N).
    pub differences: Vec<f64>,
}

/// Weights of the same outputs.
pub struct Weights {
    pub drive: Drive,
    pub slopes: Vec<f64>,
    pub differences: Vec<f64>,
}

impl Balance {
    /// With these columns of the model, and these alternatives, whose internal states stay where they are at rest.
    ///
    /// # Errors
    /// See [`Equation::of`].
    pub fn new(
        model: &Model,
        active: &[usize],
        alternatives: &[Model],
    ) -> Result<Self, ExciteError> {
        let equation = Equation::of(model)?;
        let n = equation.joints();
        let mut graph = Graph::new();
        let motion = MotionNodes::inputs(&mut graph, n);
        let command = command(&mut graph, model, &equation, &motion);
        let [law, share] = law(&mut graph, model, &motion, &command);
        let both = [command.clone(), law.clone()].concat();
        let rates = motion.rates(&mut graph, &both);
        let (command_rates, law_rates) = rates.split_at(n);
        let drive = [&command[..], &law, command_rates, law_rates].concat();
        let delayed: Vec<Node> = (0..n)
            .map(|j| graph.mul(share[j], command_rates[j]))
            .collect();
        let slopes = slopes(&mut graph, &equation, &motion, &command, active, &delayed);
        let entries = (0..n).flat_map(|joint| (0..active.len()).map(move |column| (joint, column)));
        let entries: Vec<(usize, usize)> = entries
            .filter(|(joint, column)| !graph.is_zero(slopes[*joint][*column]))
            .collect();
        let mut differences = Vec::new();
        for alternative in alternatives {
            let other = Equation::of(alternative)?;
            let found = other.append(&other.residual, &mut graph, &motion, &command);
            let late = lateness(&other.dynamics, n);
            let own = lateness(&equation.dynamics, n);
            for joint in 0..n {
                let by = graph.constant(late[joint] - own[joint]);
                let part = graph.mul(by, delayed[joint]);
                differences.push(graph.add(found[joint], part));
            }
        }
        let shown = entries
            .iter()
            .map(|(joint, column)| slopes[*joint][*column]);
        let outputs: Vec<Node> = drive
            .iter()
            .copied()
            .chain(shown)
            .chain(differences)
            .collect();
        let mut reverse = graph.clone();
        let weights: Vec<Node> = (0..outputs.len())
            .map(|k| reverse.input(&format!("w{k}")))
            .collect();
        let gradient = reverse.gradient(&outputs, &weights, &motion.all());
        Ok(Self {
            joints: n,
            entries,
            alternatives: alternatives.len(),
            drive: graph.clone().finish(&drive),
            forward: graph.finish(&outputs),
            adjoint: reverse.finish(&gradient),
        })
    }

    /// What drives a motion at these times (s).
    pub fn drive(&self, times: &[f64], motion: &Motion) -> Drive {
        let mut drive = Drive::default();
        self.over_rows(
            &self.drive,
            times,
            motion,
            |_| (),
            |tape, lane| drive.read(self.joints, tape, lane),
        );
        drive
    }

    /// What drives it, its slopes and the differences under the alternatives.
    pub fn along(&self, times: &[f64], motion: &Motion) -> Along {
        let mut along = Along {
            drive: Drive::default(),
            slopes: Vec::new(),
            differences: Vec::new(),
        };
        let (first, entries) = (4 * self.joints, self.entries.len());
        let end = first + entries + self.alternatives * self.joints;
        self.over_rows(
            &self.forward,
            times,
            motion,
            |_| (),
            |tape, lane| {
                along.drive.read(self.joints, tape, lane);
                let output = |k: usize| tape.output(k)[lane];
                along.slopes.extend((first..first + entries).map(output));
                along.differences.extend((first + entries..end).map(output));
            },
        );
        along
    }

    /// The gradient of the sum of all these, each times its weight, with respect to the motion.
    pub fn pull_back(&self, times: &[f64], motion: &Motion, weights: &Weights) -> Motion {
        let n = self.joints;
        let mut gradient: Motion = Default::default();
        let wide = self.alternatives * n;
        let parts = weights.drive.parts().map(|part| (part, n)).into_iter();
        let parts: Vec<(&Vec<f64>, usize)> = parts
            .chain([
                (&weights.slopes, self.entries.len()),
                (&weights.differences, wide),
            ])
            .collect();
        let first = DERIVATIVES * n + 1 + SEEDS * n;
        let set = |block: (&mut Tape<f64, LANES>, usize)| {
            let (tape, start) = block;
            let mut next = first;
            for (part, width) in &parts {
                for k in 0..*width {
                    tape.moving()[next] = Lane::from_fn(|lane| {
                        let row = (start + lane).min(times.len() - 1);
                        part[row * width + k]
                    });
                    next += 1;
                }
            }
        };
        self.over_rows(&self.adjoint, times, motion, set, |tape, lane| {
            for (derivative, all) in gradient.iter_mut().enumerate() {
                all.extend((0..n).map(|joint| tape.output(derivative * n + joint)[lane]));
            }
        });
        gradient
    }

    /// Evaluate a program at each row of a motion: `set` puts what follows the motion among the inputs, from a row on;
    /// `see` reads one lane.
    fn over_rows(
        &self,
        program: &Program,
        times: &[f64],
        motion: &Motion,
        set: impl Fn((&mut Tape<f64, LANES>, usize)),
        mut see: impl FnMut(&Tape<f64, LANES>, usize),
    ) {
        let n = self.joints;
        let mut tape = program.tape::<f64, LANES>();
        for start in (0..times.len()).step_by(LANES) {
            let row = |lane: usize| (start + lane).min(times.len() - 1);
            for (derivative, all) in motion.iter().enumerate() {
                for joint in 0..n {
                    tape.moving()[derivative * n + joint] =
                        Lane::from_fn(|lane| all[row(lane) * n + joint]);
                }
            }
            tape.moving()[DERIVATIVES * n] = Lane::from_fn(|lane| times[row(lane)]);
            set((&mut tape, start));
            tape.run();
            for lane in 0..LANES.min(times.len() - start) {
                see(&tape, lane);
            }
        }
    }
}

impl Drive {
    fn read(&mut self, joints: usize, tape: &Tape<f64, LANES>, lane: usize) {
        for (k, part) in self.parts_mut().into_iter().enumerate() {
            part.extend((0..joints).map(|joint| tape.output(k * joints + joint)[lane]));
        }
    }

    /// In the order of its fields.
    pub fn parts(&self) -> [&Vec<f64>; 4] {
        [
            &self.command,
            &self.torque,
            &self.command_rate,
            &self.torque_rate,
        ]
    }

    /// As above.
    pub fn parts_mut(&mut self) -> [&mut Vec<f64>; 4] {
        [
            &mut self.command,
            &mut self.torque,
            &mut self.command_rate,
            &mut self.torque_rate,
        ]
    }

    /// Zeros for this many values.
    pub fn zeros(count: usize) -> Self {
        let zeros = || vec![0.0; count];
        Self {
            command: zeros(),
            torque: zeros(),
            command_rate: zeros(),
            torque_rate: zeros(),
        }
    }
}

/// The derivative of each output with respect to the input at its place.
fn own_slopes(graph: &mut Graph, outputs: &[Node], inputs: &[Node]) -> Vec<Node> {
    let one = graph.constant(1.0);
    let both = outputs.iter().zip(inputs);
    both.map(|(output, input)| graph.gradient(&[*output], &[one], &[*input])[0])
        .collect()
}

/// The command of each joint that makes the balance zero.
fn command(
    graph: &mut Graph,
    model: &Model,
    equation: &Equation,
    motion: &MotionNodes,
) -> Vec<Node> {
    let mut command: Vec<Node> = match model.drive_program() {
        // A position loop commands about the angle that it reaches.
        Some(_) => motion.q.clone(),
        None => vec![graph.constant(0.0); equation.joints()],
    };
    let steps = match equation.is_linear() {
        true => 1,
        false => NEWTON_STEPS,
    };
    let slopes = equation.by_own_command();
    for _ in 0..steps {
        let residual = equation.append(&equation.residual, graph, motion, &command);
        let slopes = equation.append(&slopes, graph, motion, &command);
        for (command, (residual, slope)) in command.iter_mut().zip(residual.iter().zip(&slopes)) {
            let step = graph.div(*residual, *slope);
            *command = graph.sub(*command, step);
        }
    }
    command
}

/// The torque that commands ask for, and by how much each joint's changes with its command.
fn law(graph: &mut Graph, model: &Model, motion: &MotionNodes, command: &[Node]) -> [Vec<Node>; 2] {
    let n = command.len();
    let Some(law) = model.drive_program() else {
        return [command.to_vec(), vec![graph.constant(1.0); n]];
    };
    let mut inner = Graph::new();
    let names = law.inputs().iter();
    let own: Vec<Node> = names.map(|name| inner.input(name)).collect();
    let torques = inner.append(&law, &own);
    let shares = own_slopes(&mut inner, &torques, &own[2 * n..3 * n]);
    let both = inner.finish(&[torques, shares].concat());
    let values: Vec<Node> = (model.parameters.iter())
        .map(|parameter| graph.constant(parameter.value))
        .collect();
    let inputs = [&motion.q[..], &motion.qd, command, &[motion.time], &values].concat();
    let both = graph.append(&both, &inputs);
    [both[..n].to_vec(), both[n..].to_vec()]
}

/// The time by which a model's delays and lags hold each joint's command back, s.
fn lateness(dynamics: &Dynamics, joints: usize) -> Vec<f64> {
    let mut late = vec![0.0; joints];
    for filter in &dynamics.filters {
        late[filter.joint.index()] += dynamics.parameters[filter.parameter].value;
    }
    late
}

/// The derivatives of the balance with respect to the active parameters, `[joint][column]`. Delays and lags act to first
/// order: both hold the torque back by their value times its rate.
fn slopes(
    graph: &mut Graph,
    equation: &Equation,
    motion: &MotionNodes,
    command: &[Node],
    active: &[usize],
    delayed: &[Node],
) -> Vec<Vec<Node>> {
    let program = equation.derived(|graph, outputs, inputs| {
        let first = inputs.len() - equation.dynamics.parameters.len();
        let columns: Vec<Node> = active.iter().map(|k| inputs[first + k]).collect();
        graph.jacobian(outputs, &columns).concat()
    });
    let slopes = equation.append(&program, graph, motion, command);
    let mut slopes: Vec<Vec<Node>> = match active.is_empty() {
        true => vec![Vec::new(); equation.joints()],
        false => slopes
            .chunks_exact(active.len())
            .map(<[Node]>::to_vec)
            .collect(),
    };
    for filter in &equation.dynamics.filters {
        if let Some(column) = active.iter().position(|k| *k == filter.parameter) {
            let joint = filter.joint.index();
            match filter.kind {
                CommandFilter::Delay | CommandFilter::Lag => slopes[joint][column] = delayed[joint],
            }
        }
    }
    slopes
}
