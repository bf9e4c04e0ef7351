mod play;
mod transmission;
#[cfg(test)]
pub(crate) use transmission::tests::{elastic, loose, viscous};

use std::ops::Range;

use self::transmission::Motor;
use super::dynamics::{Dynamics, Parameter, PerLogValue};
use super::effect::{Effect, Entry, PLACE, RATIO};
use super::filter::Filter;
use super::fitted::FittedEffect;
use super::internal_state::{InternalStates, mean_rates};
use super::inverse_dynamics::InverseDynamics;
use super::reader::Located;
use super::system::{Model, Motion};
use crate::data::{Joint, NOMINAL, Quantity};
use crate::expr::{Formula, Graph, Node, Op, Program, Scope, SignForm};

impl Model {
    /// The equations and effects compiled into one program, with the model's own values and smoothing.
    ///
    /// Command filters act first; then the drive turns the command into a torque, the other effects on the torque
    /// follow in their order, and forces are added last. `load` is the torque before forces are added.
    pub fn dynamics(&self) -> Dynamics {
        let sign = self.sign();
        let (mut assembly, reading) = self.driven(&sign);
        let accelerations = assembly.accelerations();
        let outputs = [&assembly.shown_qd, &accelerations, &assembly.rates].map(Vec::as_slice);
        let program = self.of_a_step(assembly.graph.finish(&outputs.concat()));
        Dynamics {
            reading: reading.map(|reading| self.of_a_step(reading)),
            ..self.compiled(program)
        }
    }

    /// All torques and forces that act over a step, and what the sensors show.
    fn driven<'a>(&'a self, sign: &'a [SignForm]) -> (Assembly<'a>, Option<Program>) {
        let mut assembly = Assembly::new(self, &self.effects, sign);
        assembly.begin_step();
        assembly.apply_drive();
        let reading = assembly.reading();
        assembly.apply_sensors();
        assembly.apply_torque_effects();
        assembly.apply_transmissions();
        assembly.apply_forces();
        (assembly, reading)
    }

    /// The states that the effects have of their own.
    fn internal_states(&self) -> Option<InternalStates> {
        let names = self.state_names();
        if names.is_empty() {
            return None;
        }
        let sign = self.sign();
        let (mut assembly, _) = self.driven(&sign);
        if !assembly.motors.is_empty() {
            assembly.accelerations();
        }
        let rates = self.of_a_step(assembly.graph.finish(&assembly.rates));
        let programs = [rates, self.internal_starts()];
        let settled = self.effects.iter().flat_map(|effect| {
            let states = effect.effect.states.iter();
            states.map(|_| effect.effect.is_transmission())
        });
        Some(InternalStates::new(
            (names, settled.collect()),
            programs,
            self.layout(),
            &self.filters(),
        ))
    }

    /// Their values before a log begins, from all parameters.
    fn internal_starts(&self) -> Program {
        let mut graph = Graph::new();
        let parameters = self.all_parameters();
        let nodes: Vec<Node> = parameters.iter().map(|p| graph.input(&p.name)).collect();
        let mut starts = Vec::new();
        for (FittedEffect { effect, .. }, place) in self.placed() {
            let mut scope = Scope::new(SignForm::Exact);
            for (name, node) in effect.names().zip(&nodes[place]) {
                scope.bind(name, *node);
            }
            let states = effect.states.iter();
            starts.extend(states.map(|state| state.start(&mut graph, &scope)));
        }
        graph.finish(&starts)
    }

    /// The names of the effects' own states.
    fn state_names(&self) -> Vec<String> {
        if self.layout().internal().is_empty() {
            return Vec::new();
        }
        let parameters = self.all_parameters();
        let mut names: Vec<String> = Vec::new();
        for effect in &self.effects {
            let taken = parameters.iter().map(|p| p.name.as_str());
            let taken = taken.chain(names.iter().map(String::as_str));
            let taken: Vec<&str> = self.own_names().chain(taken).collect();
            names.extend(effect.state_names(&taken));
        }
        names
    }

    /// The program of a step, with what describes the step before the parameters.
    fn of_a_step(&self, program: Program) -> Program {
        match self.layout().internal().is_empty() {
            true => program,
            false => self.with_parameters_last(&program),
        }
    }

    /// A program with the values of the model's parameters.
    fn compiled(&self, program: Program) -> Dynamics {
        Dynamics {
            name: self.name.clone(),
            joints: self.joints,
            measured: self.measured_names().map(str::to_owned).collect(),
            parameters: self.all_parameters(),
            program,
            internal: self.internal_states(),
            filters: self.filters(),
            reading: None,
            own: self.per_log_values(),
            configurations: self.configurations.clone(),
        }
    }

    /// The torque balance, compiled like [`Model::dynamics`]: the program's outputs are, for each joint, the torque
    /// (N m, or N) that a motion needs beyond what acts after all effects; zero if the model is right. If the acting
    /// torque does not change one to one with the commanded one, or with the one that the drive's law asks for, the
    /// difference is expressed in terms of that, to first order. Its inputs are those of [`Dynamics`] with the
    /// accelerations `qdd1..qddn` before the parameters. `None` for a model that gives accelerations, which has no
    /// torques.
    pub fn torque_balance(&self) -> Option<Dynamics> {
        let sign = self.sign();
        let mut assembly = Assembly::new(self, &self.effects, &sign);
        let qdd = assembly.of_joints("qdd");
        self.balanced(assembly, &qdd)
    }

    /// The same for low-passed torques, which do not jump where friction does: the inputs after the accelerations are
    /// the directions `direction1..directionn`, the signs of the velocities low-passed like the torques.
    pub fn smoothed_torque_balance(&self) -> Option<Dynamics> {
        let sign = self.sign();
        let mut assembly = Assembly::new(self, &self.effects, &sign);
        let qdd = assembly.of_joints("qdd");
        assembly.directions = assembly.of_joints("direction");
        self.balanced(assembly, &qdd)
    }

    /// Which joints have dry friction, which takes any torque while they rest; none of a model without a torque balance.
    pub fn dry_joints(&self) -> Vec<bool> {
        let Some(balance) = self.smoothed_torque_balance() else {
            return vec![false; self.joints];
        };
        let ops = balance.program.ops();
        let is_read = |input: usize| {
            let mut operands = ops.iter().flat_map(|op| op.operands());
            operands.any(|node| matches!(ops[node.index()], Op::Input(at) if at as usize == input))
        };
        balance.layout().directions().map(is_read).collect()
    }

    fn balanced(&self, mut assembly: Assembly<'_>, qdd: &[Node]) -> Option<Dynamics> {
        assembly.apply_drive();
        let commanded = assembly.tau.clone();
        assembly.apply_sensors();
        assembly.apply_torque_effects();
        assembly.apply_transmissions();
        assembly.apply_forces();
        let needed = assembly.torques_of_shown(qdd)?;
        let mut graph = assembly.graph;
        let one = graph.constant(1.0);
        let difference = |j: usize| {
            let of_torques = graph.sub(needed[j], assembly.tau[j]);
            let slope = graph.gradient(&assembly.tau[j..=j], &[one], &commanded[j..=j])[0];
            // A command without effect has slope zero: its difference stays a torque.
            let slope = graph.select(slope, slope, one);
            graph.div(of_torques, slope)
        };
        let differences: Vec<Node> = (0..self.joints).map(difference).collect();
        let program = graph.finish(&differences);
        Some(self.compiled(self.with_parameters_last(&program)))
    }

    /// The same program, whose first inputs end with the time, with its parameters as the last.
    fn with_parameters_last(&self, program: &Program) -> Program {
        let (moving, rest) = program.inputs().split_at(self.layout().time() + 1);
        let (parameters, more) = rest.split_at(self.values().len());
        let mut graph = Graph::new();
        let mut inputs = |names: &[String]| -> Vec<Node> {
            names.iter().map(|name| graph.input(name)).collect()
        };
        let (moving, more, parameters) = (inputs(moving), inputs(more), inputs(parameters));
        let outputs = graph.append(program, &[moving, parameters, more].concat());
        graph.finish(&outputs)
    }

    /// The mass matrix, row by row, and the bias as a program with the inputs of [`Dynamics`]; `None` for a model that
    /// gives accelerations.
    pub(super) fn mass_and_bias_program(&self) -> Option<Program> {
        let sign = self.sign();
        let mut assembly = Assembly::new(self, &self.effects, &sign);
        assembly.apply_drive();
        assembly.apply_sensors();
        let (matrix, bias) = assembly.mass_and_bias()?;
        Some(assembly.graph.finish(&[matrix.concat(), bias].concat()))
    }

    /// The inertia that each joint has for its torque while the others are free (kg m^2 or kg), from the declared equations
    /// at rest with all angles at zero.
    pub fn joint_inertias(&self) -> Vec<f64> {
        let still = vec![0.0; self.joints];
        let declared = self.with_effects(Vec::new());
        let (_, mobility) = declared.inverse_dynamics().forward(&still, &still);
        mobility.diagonal().iter().map(|of| of.recip()).collect()
    }

    /// The torques that accelerate the joints as wanted, without the lag of states that effects have of their own.
    pub fn inverse_dynamics(&self) -> InverseDynamics {
        let sign = self.sign();
        let mut assembly = Assembly::new(self, &self.effects, &sign);
        assembly.apply_drive();
        let torques = assembly.tau.clone();
        assembly.apply_torque_effects();
        assembly.apply_forces();
        let accelerations = assembly.accelerations();
        let slopes = (accelerations.iter())
            .flat_map(|of| assembly.slopes(*of, &torques))
            .collect::<Vec<Node>>();
        let outputs = [accelerations, slopes].concat();
        let program = assembly.graph.finish(&outputs);
        let layout = self.layout();
        let mut inputs = vec![0.0; layout.time() + 1];
        inputs[layout.driving().end..layout.time()].fill(NOMINAL);
        inputs.extend(self.values());
        InverseDynamics::new(program, inputs, self.joints)
    }

    /// Every parameter of the model: the declared ones, then those of the effects, in their order.
    pub fn all_parameters(&self) -> Vec<Parameter> {
        let mut parameters = self.parameters.clone();
        for effect in &self.effects {
            let known = parameters.iter().map(|p| p.name.as_str());
            let taken: Vec<&str> = self.own_names().chain(known).collect();
            let of_effect = effect.parameters(&taken, self.prismatic[effect.joint]);
            parameters.extend(of_effect);
        }
        parameters
    }

    /// How many parameters fits may change, effect parameters included.
    pub fn free_parameters(&self) -> usize {
        let all = self.all_parameters();
        all.iter().filter(|parameter| !parameter.fixed).count()
    }

    fn filters(&self) -> Vec<Filter> {
        let filter = |(effect, place): (&FittedEffect, Range<usize>)| match effect.effect.entry {
            Entry::Command(kind) => Some(Filter {
                joint: effect.joint,
                kind,
                parameter: place.start,
            }),
            _ => None,
        };
        self.placed().filter_map(filter).collect()
    }

    /// The per-log values, each with its parameter's index among all parameters.
    pub fn per_log_values(&self) -> Vec<PerLogValue> {
        let of_effect = |(effect, place): (&FittedEffect, Range<usize>)| {
            let own = effect.own.iter().map(move |own| PerLogValue {
                parameter: place.start + own.parameter,
                ..own.clone()
            });
            own.collect::<Vec<_>>()
        };
        let declared = self.own.iter().cloned();
        declared.chain(self.placed().flat_map(of_effect)).collect()
    }
}

/// An effect on the sum of two joints' coordinates, each with its share.
struct Coupling {
    shares: [(Joint, Node); 2],
    /// Generalised force on the sum, without the inertial part.
    force: Node,
    inertia: Node,
}

/// An effect with the nodes of its parameters and the places of its states among all internal ones.
struct Placed<'a> {
    effect: &'a FittedEffect,
    parameters: Vec<Node>,
    states: Range<usize>,
}

impl Placed<'_> {
    /// The value of a parameter that the effect needs by name.
    fn value(&self, name: &str) -> f64 {
        self.effect.values[self.place(name)].0
    }

    fn place(&self, name: &str) -> usize {
        let place = self.effect.effect.names().position(|own| own == name);
        place.expect("checked when the file was read")
    }
}

/// A step that begins: the internal states at its start, and its length.
struct Step {
    starts: Vec<Node>,
    length: Node,
}

/// The program under construction.
struct Assembly<'a> {
    system: &'a Model,
    effects: Vec<Placed<'a>>,
    sign: &'a [SignForm],
    graph: Graph,
    /// The angle of the rig, once sensors are accounted for; of the links, once transmissions are applied.
    q: Vec<Node>,
    qd: Vec<Node>,
    /// The speeds that the sensors show.
    shown_qd: Vec<Node>,
    /// The motors behind transmissions.
    motors: Vec<Motor>,
    /// The internal states of all effects, in their order.
    internal: Vec<Node>,
    /// None where the internal states are given.
    step: Option<Step>,
    /// The mean rates of the internal states over the step; zero until their effect is applied.
    rates: Vec<Node>,
    /// The torque after what has been applied so far; the command before the drive.
    tau: Vec<Node>,
    /// The further measured columns of the model, in its order.
    measured: Vec<Node>,
    time: Node,
    declared: Vec<Node>,
    /// The signs of the velocities, if given.
    directions: Vec<Node>,
}

impl<'a> Assembly<'a> {
    fn new(system: &'a Model, effects: &'a [FittedEffect], sign: &'a [SignForm]) -> Self {
        let mut graph = Graph::new();
        let mut numbered = |stem: &str| -> Vec<Node> {
            Joint::all(system.joints)
                .map(|joint| graph.input(&joint.name(stem)))
                .collect()
        };
        let [q, qd] = ["q", "qd"].map(&mut numbered);
        let names = system.state_names().into_iter();
        let internal = names.map(|name| graph.input(&name)).collect();
        let tau = system.driven_by().key();
        let tau = Joint::all(system.joints).map(|joint| graph.input(&joint.name(tau)));
        let tau = tau.collect();
        let measured = system.measured_names().map(|name| graph.input(name));
        let measured = measured.collect();
        let time = graph.input("t");
        let declared = system
            .parameters
            .iter()
            .map(|p| graph.input(&p.name))
            .collect();
        let parameters = system.all_parameters();
        let of_effects = parameters[system.parameters.len()..].iter();
        let mut nodes = of_effects
            .map(|p| graph.input(&p.name))
            .collect::<Vec<_>>()
            .into_iter();
        let mut states = 0;
        let mut place = |effect: &'a FittedEffect| {
            let first = states;
            states += effect.effect.states.len();
            Placed {
                effect,
                parameters: nodes.by_ref().take(effect.values.len()).collect(),
                states: first..states,
            }
        };
        let effects = effects.iter().map(&mut place).collect();
        Self {
            system,
            effects,
            sign,
            graph,
            q,
            shown_qd: qd.clone(),
            qd,
            motors: Vec::new(),
            internal,
            step: None,
            rates: Vec::new(),
            tau,
            measured,
            time,
            declared,
            directions: Vec::new(),
        }
    }

    /// Give the internal states' values at the start of a step, and its length, as further inputs.
    fn begin_step(&mut self) {
        let names = self.system.state_names();
        if names.is_empty() {
            return;
        }
        let mut start = |name: &String| self.graph.input(&format!("{name}_before"));
        self.step = Some(Step {
            starts: names.iter().map(&mut start).collect(),
            length: self.graph.input("step_s"),
        });
        self.rates = vec![self.graph.constant(0.0); names.len()];
    }

    /// New inputs, one per joint.
    fn of_joints(&mut self, stem: &str) -> Vec<Node> {
        let joints = Joint::all(self.system.joints);
        joints
            .map(|joint| self.graph.input(&joint.name(stem)))
            .collect()
    }

    /// A further measured column.
    fn measured_as(&self, name: &str) -> Option<Node> {
        let mut names = self.system.measured_names().zip(&self.measured);
        names.find(|(own, _)| *own == name).map(|(_, node)| *node)
    }

    /// The names of what the motion does not change: the time and the further measured columns.
    fn bind_given(&self, scope: &mut Scope) {
        scope.bind("t", self.time);
        for (name, node) in self.system.measured_names().zip(&self.measured) {
            scope.bind(name, *node);
        }
    }

    fn give_directions(&self, scope: &mut Scope) {
        for (qd, direction) in self.shown_qd.iter().zip(&self.directions) {
            scope.give_sign(*qd, *direction);
        }
    }

    /// A drive sees the angles that its sensors show.
    fn apply_drive(&mut self) {
        let Some(drive) = &self.system.equations.drive else {
            return;
        };
        let scope = self.scope(&self.q, Quantity::Command);
        self.tau = drive.torques(&mut self.graph, &scope);
    }

    /// The state holds the sensors' angles; everything that follows uses the rig's.
    fn apply_sensors(&mut self) {
        for (index, joint, formula) in self.entries(Effect::is_of_sensor) {
            self.q[joint] = self.effect_node(index, formula);
        }
    }

    fn apply_torque_effects(&mut self) {
        for (index, joint, formula) in
            self.entries(|effect| matches!(effect.entry, Entry::Torque(_)))
        {
            self.tau[joint] = self.effect_node(index, formula);
        }
    }

    fn apply_forces(&mut self) {
        // All forces see the torque as it was before any of them.
        let forces: Vec<(&FittedEffect, Node)> = self
            .entries(|effect| matches!(effect.entry, Entry::Force(_)))
            .into_iter()
            .map(|(index, _, formula)| {
                let effect = self.effects[index].effect;
                (effect, self.effect_node(index, formula))
            })
            .collect();
        let shares: Vec<(Joint, Node)> = (self
            .entries(|effect| matches!(effect.entry, Entry::Friction(_)))
            .into_iter())
        .map(|(index, joint, formula)| (joint, self.effect_node(index, formula)))
        .collect();
        for (effect, mut force) in forces {
            if effect.effect.is_friction() {
                for (_, share) in shares.iter().filter(|(own, _)| *own == effect.joint) {
                    force = self.graph.mul(force, *share);
                }
            }
            self.add_force(effect, force);
        }
        for coupling in self.couplings() {
            for (joint, share) in coupling.shares {
                let force = self.graph.mul(share, coupling.force);
                self.tau[joint] = self.graph.add(self.tau[joint], force);
            }
        }
    }

    /// Mass and position of the loads at tips, each with the joint that moves it.
    fn payloads(&mut self) -> Vec<(Joint, [Node; 4])> {
        let is_load = |effect: &Effect| matches!(effect.entry, Entry::Payload(_));
        let loads = self.entries(is_load).into_iter();
        loads
            .map(|(index, joint, mass)| {
                let mass = self.effect_node(index, mass);
                let [x, y, z] = PLACE.map(|name| self.parameter(index, name));
                (joint, [mass, x, y, z])
            })
            .collect()
    }

    /// A parameter that the effect needs by name.
    fn parameter(&self, index: usize, name: &str) -> Node {
        let placed = &self.effects[index];
        placed.parameters[placed.place(name)]
    }

    /// The effects on sums of two joints.
    fn couplings(&mut self) -> Vec<Coupling> {
        let indices: Vec<usize> = (0..self.effects.len())
            .filter(|k| self.effects[*k].effect.effect.is_coupling())
            .collect();
        indices.into_iter().map(|k| self.coupling(k)).collect()
    }

    fn coupling(&mut self, index: usize) -> Coupling {
        let effect = self.effects[index].effect;
        let parameters = self.effects[index].parameters.clone();
        let [joint, next] = [effect.joint, effect.joint.next()];
        let ratio = self.parameter(index, RATIO);
        let mut sum = |of: [Node; 2]| {
            let shared = self.graph.mul(ratio, of[1]);
            self.graph.add(of[0], shared)
        };
        let q = sum([self.q[joint], self.q[next]]);
        let qd = sum([self.qd[joint], self.qd[next]]);
        let wider = [self.sign[joint], self.sign[next]];
        let sign = wider
            .into_iter()
            .max_by(|a, b| width(a).total_cmp(&width(b)));
        let program = effect.effect.coupling(sign.expect("two of them"));
        let rest = self.graph.constant(0.0);
        let measured: Vec<Node> = (effect.effect.measured())
            .filter_map(|name| self.measured_as(name))
            .collect();
        let inputs = [&[q, qd, rest, self.time], &*measured, &*parameters].concat();
        let program = program.expect("the effect is a coupling");
        let out = self.graph.append(&program, &inputs);
        let one = self.graph.constant(1.0);
        Coupling {
            shares: [(joint, one), (next, ratio)],
            force: out[0],
            inertia: out[1],
        }
    }

    /// The effects that enter in one particular way: index, joint and formula.
    fn entries(&self, is_wanted: impl Fn(&Effect) -> bool) -> Vec<(usize, Joint, &'a Formula)> {
        let effects = self.effects.iter().enumerate();
        let wanted = effects.filter(|(_, placed)| is_wanted(&placed.effect.effect));
        wanted
            .filter_map(|(index, Placed { effect, .. })| {
                Some((index, effect.joint, effect.effect.entry.formula()?))
            })
            .collect()
    }

    /// An effect's formula in the variables of its joint. Its states move under the same torque.
    fn effect_node(&mut self, index: usize, formula: &Formula) -> Node {
        let scope = self.effect_scope(index);
        let Placed { effect, states, .. } = &self.effects[index];
        if let Some(step) = self.step.as_ref().filter(|_| !states.is_empty()) {
            let (starts, scope) = (&step.starts[states.clone()], scope.clone());
            let of_effect = (starts, step.length);
            let rates = mean_rates(&effect.effect.states, &mut self.graph, scope, of_effect);
            self.rates[states.clone()].copy_from_slice(&rates);
        }
        lower(&scope, &mut self.graph, formula)
    }

    /// The names that an effect's formulas may mention.
    fn effect_scope(&self, index: usize) -> Scope {
        let Placed {
            effect,
            parameters,
            states,
        } = &self.effects[index];
        let joint = effect.joint;
        let mut scope = Scope::new(self.sign[joint]);
        let of_link = [self.q[joint], self.qd[joint]];
        let motor = self.motor_under(effect);
        let [q, qd] = motor.map_or(of_link, |motor| self.motors[motor].motion);
        scope.bind("q", q);
        scope.bind("qd", qd);
        scope.bind("tau", self.tau[joint]);
        scope.bind("load", self.tau[joint]);
        self.bind_given(&mut scope);
        self.give_directions(&mut scope);
        for (name, node) in effect.effect.names().zip(parameters) {
            scope.bind(name, *node);
        }
        let states = &self.internal[states.clone()];
        for (state, node) in effect.effect.states.iter().zip(states) {
            scope.bind(&state.name, *node);
        }
        scope
    }

    fn accelerations(&mut self) -> Vec<Node> {
        let of_links = self.accelerations_of_links();
        match self.motors.is_empty() {
            true => of_links,
            false => self.accelerations_of_shown(&of_links),
        }
    }

    fn accelerations_of_links(&mut self) -> Vec<Node> {
        if let Motion::Accelerations(formulas) = &self.system.equations.motion {
            let scope = self.declared_scope();
            return self.lowered(&scope, formulas);
        }
        let (matrix, bias) = self.mass_and_bias().expect("all other models have both");
        self.solved(&matrix, &bias)
    }

    /// How much an acceleration changes for each N m of these torques.
    fn slopes(&mut self, acceleration: Node, torques: &[Node]) -> Vec<Node> {
        let one = self.graph.constant(1.0);
        self.graph.gradient(&[acceleration], &[one], torques)
    }

    /// Mass matrix and bias, inertia of effects included; `None` for a model that gives accelerations.
    fn mass_and_bias(&mut self) -> Option<(Vec<Vec<Node>>, Vec<Node>)> {
        let scope = self.declared_scope();
        let (mut matrix, bias): (Vec<Vec<Node>>, _) = match &self.system.equations.motion {
            Motion::Accelerations(_) => return None,
            Motion::MassAndBias { mass, bias } => {
                let rows = mass.iter().map(|row| self.lowered(&scope, row));
                (rows.collect(), self.lowered(&scope, bias))
            }
            Motion::Tree(bodies) => {
                let still = vec![self.graph.constant(0.0); self.system.joints];
                let payloads = self.payloads();
                let mut links = bodies.loaded(&mut self.graph, &scope, &payloads);
                (links.mass(), links.torques(&self.qd, &still))
            }
        };
        self.add_inertia(&mut matrix);
        Some((matrix, bias))
    }

    /// The torques that these accelerations need.
    fn torques(&mut self, qdd: &[Node]) -> Option<Vec<Node>> {
        let (matrix, bias) = match &self.system.equations.motion {
            Motion::Tree(bodies) => {
                let scope = self.declared_scope();
                let none = vec![self.graph.constant(0.0); self.system.joints];
                let mut matrix = vec![none; self.system.joints];
                let payloads = self.payloads();
                let mut links = bodies.loaded(&mut self.graph, &scope, &payloads);
                let bias = links.torques(&self.qd, qdd);
                self.add_inertia(&mut matrix);
                (matrix, bias)
            }
            _ => self.mass_and_bias()?,
        };
        let needed = matrix.iter().zip(bias).map(|(row, bias)| {
            let accelerating = self.graph.dot(row, qdd);
            self.graph.add(accelerating, bias)
        });
        Some(needed.collect())
    }

    fn lowered(&mut self, scope: &Scope, formulas: &[Located<Formula>]) -> Vec<Node> {
        let formulas = formulas.iter();
        formulas
            .map(|formula| lower(scope, &mut self.graph, &formula.value))
            .collect()
    }

    /// The accelerations under the torques: matrix qdd + bias = tau.
    fn solved(&mut self, matrix: &[Vec<Node>], bias: &[Node]) -> Vec<Node> {
        let both = self.tau.iter().zip(bias);
        let right: Vec<Node> = both
            .map(|(tau, bias)| self.graph.sub(*tau, *bias))
            .collect();
        self.graph.solve_spd(matrix, &right)
    }

    fn add_inertia(&mut self, matrix: &mut [Vec<Node>]) {
        for (index, joint, formula) in
            self.entries(|effect| matches!(effect.entry, Entry::Inertia(_)))
        {
            let extra = self.effect_node(index, formula);
            matrix[joint][joint] = self.graph.add(matrix[joint][joint], extra);
        }
        for Coupling {
            shares, inertia, ..
        } in self.couplings()
        {
            for (i, of_row) in shares {
                for (j, of_column) in shares {
                    let share = self.graph.mul(of_row, of_column);
                    let extra = self.graph.mul(share, inertia);
                    matrix[i][j.index()] = self.graph.add(matrix[i][j.index()], extra);
                }
            }
        }
    }

    /// The angles in the declared equations: the rig's, after effects on them.
    fn declared_angles(&mut self) -> Vec<Node> {
        self.turned(|effect| matches!(effect.entry, Entry::Angle(_)) && !effect.is_of_sensor())
    }

    /// The measured angles, if effects change them.
    fn reading(&mut self) -> Option<Program> {
        let stands_between = |effect: &Effect| matches!(effect.entry, Entry::Reading(_));
        let shown = self.turned(stands_between);
        (shown != self.q).then(|| self.graph.clone().finish(&shown))
    }

    /// The angles after some effects, applied in order.
    fn turned(&mut self, by: impl Fn(&Effect) -> bool) -> Vec<Node> {
        let before = self.q.clone();
        for (index, joint, formula) in self.entries(by) {
            self.q[joint] = self.effect_node(index, formula);
        }
        std::mem::replace(&mut self.q, before)
    }

    /// The names of these angles, of the velocities, of what drives the joints, of time and of the declared parameters.
    fn scope(&self, angles: &[Node], driven_by: Quantity) -> Scope {
        let mut scope = Scope::new(self.narrowest_sign());
        for joint in Joint::all(self.system.joints) {
            scope.bind(&joint.name("q"), angles[joint]);
            scope.bind(&joint.name("qd"), self.qd[joint]);
            scope.bind(&joint.name(driven_by.key()), self.tau[joint]);
        }
        self.bind_given(&mut scope);
        for (parameter, node) in self.system.parameters.iter().zip(&self.declared) {
            scope.bind(&parameter.name, *node);
        }
        scope
    }

    /// The names in the declared equations: angles and torques after effects on them.
    fn declared_scope(&mut self) -> Scope {
        let angles = self.declared_angles();
        let mut scope = self.scope(&angles, Quantity::Torque);
        self.give_directions(&mut scope);
        self.bind_shifted(&mut scope);
        self.system.bind_lets(&mut self.graph, &mut scope);
        scope
    }

    /// Shifted parameters take the place of the declared ones.
    fn bind_shifted(&mut self, scope: &mut Scope) {
        for (index, _, formula) in self.entries(|e| matches!(e.entry, Entry::Shift(..))) {
            if let Some(k) = self.effects[index].effect.shifted() {
                let shift = self.effect_node(index, formula);
                let shifted = self.graph.add(self.declared[k], shift);
                scope.bind(&self.system.parameters[k].name, shifted);
            }
        }
    }

    /// A declared formula may use several joints: the narrowest of their widths serves all.
    fn narrowest_sign(&self) -> SignForm {
        *self
            .sign
            .iter()
            .min_by(|a, b| width(a).total_cmp(&width(b)))
            .expect("a system has at least one joint")
    }
}

fn width(sign: &SignForm) -> f64 {
    match sign {
        SignForm::Exact => 0.0,
        SignForm::Smooth { width } => *width,
    }
}

/// Lowers a formula into a graph; it was checked when the file was read.
pub(super) fn lower(scope: &Scope, graph: &mut Graph, formula: &Formula) -> Node {
    scope
        .lower(graph, formula)
        .expect("formulas were checked when the file was read")
}
