use super::memory::Memory;
use super::{Network, Rows, W};
use crate::expr::{Graph, Node, Program, Tape};
use crate::lanes::{Arch, Element, Simd, Vector, WithSimd};
use crate::model::{Dynamics, InputLayout, MlpWeights, to_f32};
use crate::sim::Integrator;

/// Model, objective and integrator, compiled for rollouts from one state under many input sequences.
#[derive(Debug, Clone)]
pub struct Rollouts {
    /// Places of the equations' inputs.
    layout: InputLayout,
    /// Inputs: those of the equations without the parameters, the torque that led to this state, then the parameters.
    /// Outputs: ds/dt by the equations, the reward, then the scaled features of each network.
    program: Program,
    parameters: Vec<f32>,
    networks: Vec<Added>,
    /// The output that says how far the state is beyond limits, if there are any: the last.
    excess: Option<usize>,
    /// Present if the equations filter their torques, or these act later.
    memory: Option<Memory>,
    integrator: Integrator,
    step_s: f32,
}

/// A network whose outputs are added to the last components of the motion's ds/dt.
#[derive(Debug, Clone)]
pub struct Added {
    network: Network,
    first_rate: usize,
    first_feature: usize,
}

/// Working memory of [`W`] rollouts.
#[derive(Debug, Clone)]
pub struct Block<'r> {
    rollouts: &'r Rollouts,
    arch: Arch,
    tape: Tape<f32, W>,
    /// State at the start of the step, and the state accumulated so far for its end: positions, velocities, then internal
    /// states.
    state: Vec<Rows>,
    next: Vec<Rows>,
    rates: Vec<Rows>,
    /// Features and activations of each network.
    values: Vec<[Vec<Rows>; 2]>,
    /// Filtered torques, `[step * n + joint]`; unused without filters.
    acting: Vec<Rows>,
    /// Sums over the steps of each rollout; unused without limits.
    excess: Rows,
}

impl Rollouts {
    /// `equations` with the outputs of `networks` added to their derivative, in steps of `step_s` seconds, under an
    /// objective whose only output is the reward of the state at the end of a step. Its inputs are `q`, `qd` and the
    /// commanded `tau` of every joint, and `t`. If the equations filter their torques, the mean filtered torque acts
    /// over each step.
    ///
    /// # Panics
    /// When a network or the objective does not match their joints.
    #[allow(clippy::cast_possible_truncation)] // planning runs in f32
    pub fn new(
        equations: &Dynamics,
        networks: &[MlpWeights],
        objective: &Program,
        integrator: Integrator,
        step_s: f64,
    ) -> Self {
        for network in networks {
            let checked = network.check(equations.joints);
            checked.expect("networks of this system");
        }
        Self {
            layout: equations.layout(),
            program: whole(equations, networks, objective),
            parameters: equations.values().iter().map(|x| *x as f32).collect(),
            networks: added(equations.layout(), networks),
            excess: None,
            memory: Memory::new(equations, step_s),
            integrator,
            step_s: step_s as f32,
        }
    }

    /// The same for a plant with limits: `excess` says how far a state is beyond them, 0 within. It is a program with the inputs
    /// of an objective and one output; [`Block::excess`] has its sums.
    ///
    /// # Panics
    /// When `excess` does not match the joints.
    #[must_use]
    pub fn within(self, excess: &Program) -> Self {
        let mut graph = Graph::new();
        let names = self.program.inputs().iter();
        let inputs: Vec<Node> = names.map(|name| graph.input(name)).collect();
        let mut outputs = graph.append(&self.program, &inputs);
        let (layout, joints) = (self.layout, self.joints());
        let until_now = &inputs[layout.parameters()..][..joints];
        let motion = &inputs[..layout.internal().start];
        let of_state = [motion, until_now, &[inputs[layout.time()]]].concat();
        let place = outputs.len();
        outputs.extend(graph.append(excess, &of_state));
        assert_eq!(outputs.len(), place + 1, "an excess is one number");
        Self {
            program: graph.finish(&outputs),
            excess: Some(place),
            ..self
        }
    }

    /// The same for a plant on which each torque acts so many steps later.
    #[must_use]
    pub fn acting_after(self, steps: usize) -> Self {
        let joints = self.joints();
        Self {
            memory: Memory::later(self.memory, joints, steps),
            ..self
        }
    }

    /// Number of joints n.
    pub fn joints(&self) -> usize {
        self.layout.driving().len()
    }

    /// Number of steps before a plan whose torques still act in it: none without filters.
    pub fn memory(&self) -> usize {
        self.memory.as_ref().map_or(0, Memory::steps)
    }

    /// The part of the acting torque in a plan of `steps` steps that is due to the torques `past` (`[step][joint]`,
    /// oldest first, the oldest held for ever before): `[step * n + joint]`, up to the last step affected. Empty
    /// without filters.
    pub fn carried(&self, past: &[Vec<f64>], steps: usize) -> Vec<f32> {
        let memory = self.memory.as_ref();
        memory.map_or_else(Vec::new, |memory| memory.carried(past, steps))
    }

    /// Working memory for one block.
    pub fn block(&self) -> Block<'_> {
        let first = self.layout.parameters() + self.joints();
        let rows = |count: usize| vec![Rows::splat(0.0); count];
        let states = || rows(self.layout.states().len());
        let values = |added: &Added| {
            let network = &added.network;
            [rows(network.features()), rows(network.activations())]
        };
        Block {
            rollouts: self,
            arch: Arch::new(),
            tape: self.program.tape_at(first, &self.parameters),
            state: states(),
            next: states(),
            rates: states(),
            values: self.networks.iter().map(values).collect(),
            acting: Vec::new(),
            excess: Rows::splat(0.0),
        }
    }
}

pub fn added(layout: InputLayout, networks: &[MlpWeights]) -> Vec<Added> {
    let mut first_feature = layout.states().len() + 1;
    let mut add = |weights: &MlpWeights| {
        let network = Network::new(&weights.widths(), &to_f32(&weights.flat()));
        let first = first_feature;
        first_feature += network.features();
        Added {
            first_rate: layout.internal().start - network.outputs().len(),
            first_feature: first,
            network,
        }
    };
    networks.iter().map(&mut add).collect()
}

/// One program for the equations, the reward and the networks' features, so that they share their sines and cosines.
fn whole(equations: &Dynamics, networks: &[MlpWeights], objective: &Program) -> Program {
    let (n, layout) = (equations.joints, equations.layout());
    let mut graph = Graph::new();
    let (moving, parameters) = equations.program.inputs().split_at(layout.parameters());
    let mut write =
        |names: &[String]| -> Vec<Node> { names.iter().map(|name| graph.input(name)).collect() };
    let moving = write(moving);
    let until_now: Vec<String> = (1..=n).map(|j| format!("tau{j} until now")).collect();
    let (until_now, parameters) = (write(&until_now), write(parameters));
    let inputs = [moving.as_slice(), &parameters].concat();
    let mut outputs = graph.append(&equations.program, &inputs);
    let (motion, time) = (&moving[..layout.internal().start], moving[layout.time()]);
    let reward = graph.append(objective, &[motion, &until_now, &[time]].concat());
    assert_eq!(reward.len(), 1, "an objective is one number");
    outputs.extend(reward);
    for network in networks {
        let (q, qd) = motion.split_at(n);
        outputs.extend(network.features(&mut graph, q, qd, &moving[layout.driving()]));
    }
    graph.finish(&outputs)
}

impl Block<'_> {
    /// The sum of rewards of each rollout from `start` (positions, velocities, then internal states) at `time_s` under `inputs`
    /// (`[step * n + joint]`), each held for a step; `carried` is what earlier torques add to the acting ones, see
    /// [`Rollouts::carried`]. NaN or infinite if a rollout diverges.
    ///
    /// # Panics
    /// When `start` or `inputs` does not have the model's size.
    pub fn returns(
        &mut self,
        start: &[f32],
        time_s: f32,
        carried: &[f32],
        inputs: &[Rows],
        returns: &mut Rows,
    ) {
        let n = self.rollouts.joints();
        let states = self.rollouts.layout.states().len();
        assert_eq!(start.len(), states, "one value for each state");
        let is_whole = inputs.len().is_multiple_of(n);
        assert!(!inputs.is_empty() && is_whole, "whole steps");
        let mut filtered = std::mem::take(&mut self.acting);
        let acting = match &self.rollouts.memory {
            None => inputs,
            Some(memory) => {
                memory.act(self.arch, carried, inputs, &mut filtered);
                &filtered
            }
        };
        self.arch.dispatch(Run {
            block: self,
            start,
            time_s,
            inputs,
            acting,
            returns,
        });
        self.acting = filtered;
    }

    /// How far each of the last rollouts went beyond the limits, summed over the ends of its steps; `None` without limits.
    pub fn excess(&self) -> Option<&Rows> {
        self.rollouts.excess.map(|_| &self.excess)
    }
}

struct Run<'a, 'r> {
    block: &'a mut Block<'r>,
    start: &'a [f32],
    time_s: f32,
    inputs: &'a [Rows],
    acting: &'a [Rows],
    returns: &'a mut Rows,
}

impl WithSimd for Run<'_, '_> {
    type Output = ();

    /// One evaluation in the innermost loop, also for the reward after the last step, so that it is inlined only once.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (block, inputs, returns) = (self.block, self.inputs, self.returns);
        let (layout, integrator) = (block.rollouts.layout, block.rollouts.integrator);
        let n = layout.driving().len();
        let (stages, substeps) = (integrator.scheme().stages, integrator.substeps());
        let (steps, h) = (inputs.len() / n, block.rollouts.step_s / substeps as f32);
        for (row, value) in block.next.iter_mut().zip(self.start) {
            *row = Rows::splat(*value);
        }
        if !layout.internal().is_empty() {
            block.tape.moving()[layout.step()] = Rows::splat(h);
        }
        *returns = Rows::splat(0.0);
        block.excess = Rows::splat(0.0);
        for step in 0..=steps {
            block.hold(inputs, self.acting, step);
            for substep in 0..substeps {
                let begin_s = self.time_s + (step * substeps + substep) as f32 * h;
                block.begin();
                for (k, stage) in stages.iter().enumerate() {
                    let [time, reach, weight] =
                        [stage.time, stage.reach, stage.weight].map(|share| share as f32 * h);
                    block.tape.moving()[layout.time()] = Rows::splat(begin_s + time);
                    block.tape.run_on(simd);
                    if k == 0 && substep == 0 && step > 0 {
                        add(simd, returns, block.tape.output(layout.states().len()), 1.0);
                        if let Some(output) = block.rollouts.excess {
                            add(simd, &mut block.excess, block.tape.output(output), 1.0);
                        }
                        if step == steps {
                            return;
                        }
                    }
                    block.rates(simd);
                    block.advance(simd, reach, weight);
                }
                block.finish(simd, h);
            }
        }
    }
}

impl Block<'_> {
    /// Set the torque that acts over `step`, and for the reward the commanded torque of the step before.
    #[inline(always)]
    fn hold(&mut self, inputs: &[Rows], acting: &[Rows], step: usize) {
        let (layout, n) = (self.rollouts.layout, self.rollouts.joints());
        let slots = self.tape.moving();
        if let Some(now) = acting[step * n..].get(..n) {
            slots[layout.driving()].copy_from_slice(now);
        }
        if step > 0 {
            slots[layout.parameters()..].copy_from_slice(&inputs[(step - 1) * n..][..n]);
        }
    }

    /// Start a substep from the end of the last one.
    #[inline(always)]
    fn begin(&mut self) {
        self.state.copy_from_slice(&self.next);
        let layout = self.rollouts.layout;
        let slots = self.tape.moving();
        slots[layout.states()].copy_from_slice(&self.next);
        if !layout.internal().is_empty() {
            slots[layout.starts()].copy_from_slice(&self.next[layout.internal()]);
        }
    }

    /// ds/dt at the tape's inputs: equations plus networks.
    #[inline(always)]
    fn rates<S: Simd>(&mut self, simd: S) {
        for (k, rate) in self.rates.iter_mut().enumerate() {
            *rate = *self.tape.output(k);
        }
        for (added, [features, activations]) in self.rollouts.networks.iter().zip(&mut self.values)
        {
            for (k, feature) in features.iter_mut().enumerate() {
                *feature = *self.tape.output(added.first_feature + k);
            }
            added.network.forward(simd, features, activations);
            let parts = &activations[added.network.outputs()];
            for (rate, part) in self.rates[added.first_rate..].iter_mut().zip(parts) {
                add(simd, rate, part, 1.0);
            }
        }
    }

    /// Add this stage's slope to the step, and set the inputs of the next stage.
    #[inline(always)]
    fn advance<S: Simd>(&mut self, simd: S, reach: f32, weight: f32) {
        let inner = self.tape.moving();
        for (k, rate) in self.rates.iter().enumerate() {
            add(simd, &mut self.next[k], rate, weight);
            inner[k] = self.state[k];
            add(simd, &mut inner[k], rate, reach);
        }
    }

    /// The end of a substep of length `h`.
    #[inline(always)]
    fn finish<S: Simd>(&mut self, simd: S, h: f32) {
        if self.rollouts.integrator.scheme().semi_implicit {
            let (positions, _) = self.next.split_at_mut(self.rollouts.joints());
            let accelerations = &self.rates[positions.len()..];
            for (position, acceleration) in positions.iter_mut().zip(accelerations) {
                add(simd, position, acceleration, h * h);
            }
        }
    }
}

/// sum += factor * term
#[inline(always)]
fn add<S: Simd>(simd: S, sum: &mut Rows, term: &Rows, factor: f32) {
    let factor = Vector::splat(simd, factor);
    let terms = f32::registers::<S>(&**term);
    for (sum, term) in f32::registers_mut::<S>(&mut **sum).iter_mut().zip(terms) {
        let term = Vector::new(simd, *term);
        *sum = term.mul_add(factor, Vector::new(simd, *sum)).register;
    }
}
