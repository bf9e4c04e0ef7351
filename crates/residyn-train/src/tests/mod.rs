//! Tests of training on a simulated pendulum, and the parts that they share.

mod checkpoints;
mod environment;
mod fused;
mod gradients;
mod module;
mod optimizers;
mod parity;
mod recovery;
mod resume;
mod shrinking;

use std::ops::ControlFlow;

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use rand::RngExt;

use super::hybrid::vector;
use super::loss::numbers;
use super::{Backend, Batch, Ended, FitSettings, HybridModel, Objective, Segments, Training};
use residyn_core::expr::{Graph, Scope, SignForm, parse};
use residyn_core::model::{Dynamics, LastLayer, MlpSettings, MlpWeights, Parameter};
pub(super) use residyn_core::rng;

pub(super) const DT: f64 = 0.02;

pub(super) fn parameter(name: &str, value: f64) -> Parameter {
    Parameter {
        name: name.to_owned(),
        value,
        unit: String::new(),
        bounds: [f64::NEG_INFINITY, f64::INFINITY],
        fixed: false,
        per_log: false,
        per_group: false,
        ci95: None,
        scale: value.abs(),
    }
}

/// qdd1 = `formula` of q1, qd1, tau1, t and the parameters.
pub(super) fn one_joint(formula: &str, parameters: Vec<Parameter>) -> Dynamics {
    let mut graph = Graph::new();
    let mut scope = Scope::new(SignForm::Exact);
    let states = ["q1", "qd1", "tau1", "t"].into_iter();
    for name in states.chain(parameters.iter().map(|p| p.name.as_str())) {
        let node = graph.input(name);
        scope.bind(name, node);
    }
    let acceleration = scope.lower(&mut graph, &parse(formula).unwrap()).unwrap();
    let velocity = scope.get("qd1").unwrap();
    Dynamics {
        name: "pendulum".to_owned(),
        joints: 1,
        measured: Vec::new(),
        internal: None,
        parameters,
        program: graph.finish(&[velocity, acceleration]),
        filters: Vec::new(),
        reading: None,
        own: Vec::new(),
        configurations: Vec::new(),
    }
}

/// The frictionless pendulum.
pub(super) fn pendulum(c_g: f64, c_i: f64) -> Dynamics {
    one_joint(
        "C_g * sin(q1) + C_i * tau1",
        vec![parameter("C_g", c_g), parameter("C_i", c_i)],
    )
}

/// `count` transitions from random states of the pendulum C_g = 15, C_i = 3 with this viscous friction,
/// by semi-implicit Euler in f64.
pub(super) fn transitions(count: usize, friction: f64, seed: u64) -> Segments {
    let plant = one_joint(
        "15 * sin(q1) + 3 * tau1 + C_fr * qd1",
        vec![parameter("C_fr", friction)],
    );
    let mut rng = rng(seed);
    let mut segments = Segments::new(1, 1);
    let pi = std::f64::consts::PI;
    for _ in 0..count {
        let (q, v) = (rng.random_range(-pi..pi), rng.random_range(-8.0..8.0));
        let tau = rng.random_range(-3.0..3.0);
        let next = v + DT * plant.program.eval(&[q, v, tau, 0.0, friction])[1];
        segments
            .push_trajectory(&[0.0, DT], &[q, v, q + DT * next, next], &[tau, 0.0], 1)
            .unwrap();
    }
    segments
}

/// A pendulum with a residual of the published size, scaled to the segments.
pub(super) fn hybrid(
    (c_g, c_i): (f64, f64),
    segments: &Segments,
    backend: Backend,
    last: LastLayer,
) -> HybridModel {
    let residual = segments.network(&MlpSettings::for_joints(1), last, &mut rng(7));
    hybrid_of(&pendulum(c_g, c_i), &residual, &backend.device())
}

/// A model of these equations and this residual.
pub(super) fn hybrid_of(
    dynamics: &Dynamics,
    residual: &MlpWeights,
    device: &Device,
) -> HybridModel {
    HybridModel::physics(dynamics, device)
        .and_then(|model| model.with_residual(residual))
        .unwrap()
}

/// The usual settings with this many epochs.
pub(super) fn epochs(epochs: usize) -> FitSettings {
    FitSettings {
        epochs,
        ..FitSettings::default()
    }
}

/// A run of all epochs without validation.
pub(super) fn fit(model: HybridModel, segments: &Segments, settings: FitSettings) -> Training {
    let mut training = Training::new(model, settings, rng(3)).unwrap();
    run(&mut training, segments);
    training
}

/// Trains to the last epoch.
pub(super) fn run(training: &mut Training, segments: &Segments) {
    let ended = training.run(segments, None, &mut |_| ControlFlow::Continue(()));
    assert_eq!(ended.unwrap(), Ended::Finished);
}

/// A loss with its gradient.
pub(super) struct Gradient {
    /// E and ||F_r||.
    pub loss: [f64; 2],
    /// The gradient of their weighted sum by the physical parameters and each network's numbers, in Burn's order.
    pub by_numbers: Vec<f32>,
}

/// The loss, and the gradient of the sum of its parts times `weights`.
pub(super) fn gradient(
    objective: &Objective,
    model: &HybridModel,
    batch: &Batch,
    weights: [f64; 2],
) -> Gradient {
    let loss = objective.loss(model, batch);
    let total = (loss.clone() * vector(&weights, &loss.device())).sum();
    let gradients = GradientsParams::from_grads(total.backward(), model);
    let mut flat = FlatGradient {
        gradients: &gradients,
        numbers: Vec::new(),
    };
    model.visit(&mut flat);
    Gradient {
        loss: numbers(loss),
        by_numbers: flat.numbers,
    }
}

/// The entries of all gradients, and zero for each number without one.
struct FlatGradient<'g> {
    gradients: &'g GradientsParams,
    numbers: Vec<f32>,
}

impl ModuleVisitor for FlatGradient<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let gradient = self.gradients.get::<D>(param.id);
        let gradient = gradient.unwrap_or_else(|| param.val().inner().zeros_like());
        self.numbers.extend(gradient.into_data().iter::<f32>());
    }
}
