//! The fused loss against the composed one.

use burn::tensor::Device;
use rand::RngExt;

use super::{
    Gradient, epochs, fit, gradient, hybrid, hybrid_of, one_joint, parameter, rng, run, transitions,
};
use crate::{Backend, Batch, HybridModel, Objective, Segments, Training};
use residyn_core::model::{
    Angles, Dynamics, LastLayer, Library, MlpSettings, MlpWeights, ResidualOn,
};
use residyn_core::sim::Integrator;

/// Segments of `steps` irregular steps that lead through random states.
pub(super) fn segments(joints: usize, count: usize, steps: usize) -> Segments {
    let mut rng = rng(5);
    let mut segments = Segments::new(joints, steps);
    for _ in 0..count {
        let mut time = vec![0.3];
        for k in 0..steps {
            time.push(time[k] + rng.random_range(0.01..0.05));
        }
        let mut numbers = |count| (0..count).map(|_| rng.random_range(-2.0..2.0)).collect();
        let states: Vec<f64> = numbers(2 * joints * (steps + 1));
        let inputs: Vec<f64> = numbers(joints * (steps + 1));
        segments
            .push_trajectory(&time, &states, &inputs, 1)
            .unwrap();
    }
    segments
}

/// The library's equations, with one parameter held.
pub(super) fn equations(joints: usize) -> Dynamics {
    let name = ["pendulum", "acrobot"][joints - 1];
    let mut dynamics = Library::built_in().model(name).unwrap().dynamics();
    dynamics.parameters[1].fixed = true;
    dynamics
}

pub(super) fn network(joints: usize, angles: Angles, on: ResidualOn, seed: u64) -> MlpWeights {
    let settings = MlpSettings {
        hidden: vec![16, 13],
        angles,
        on,
    };
    segments(joints, 50, 1).network(&settings, LastLayer::Random, &mut rng(seed))
}

/// Every kind of model with this many joints.
fn models(joints: usize, device: &Device) -> Vec<HybridModel> {
    let physics = HybridModel::physics(&equations(joints), device).unwrap();
    let mut models = vec![physics.clone()];
    for angles in [Angles::Raw, Angles::SinCos] {
        for on in [ResidualOn::Accelerations, ResidualOn::Derivative] {
            let residual = network(joints, angles, on, 7);
            let prior = network(joints, angles, on, 8);
            let network = HybridModel::network("system", joints, &prior, device).unwrap();
            models.push(physics.clone().with_residual(&residual).unwrap());
            models.push(network.clone().with_residual(&residual).unwrap());
            models.push(network);
        }
    }
    models
}

/// The loss and its gradient with the weights of a training run.
fn weighted(model: &HybridModel, batch: &Batch, objective: &Objective) -> Gradient {
    let of_norm = if model.residual.is_some() { 1.3 } else { 0.0 };
    gradient(objective, model, batch, [0.7, of_norm])
}

fn norm(numbers: impl Iterator<Item = f32>) -> f64 {
    numbers.map(|x| f64::from(x).powi(2)).sum::<f64>().sqrt()
}

/// Sums of f32 in another order: some 1e-7 for each of the few hundred operations on the way.
fn assert_agrees(model: &HybridModel, segments: &Segments, integrator: Integrator) {
    let scale: Vec<f64> = (1..=2 * model.joints()).map(|k| 0.3 * k as f64).collect();
    let objective = Objective::new(integrator, Some(&scale), model.joints()).unwrap();
    let fused = objective.all(segments, &model.device());
    assert!(matches!(fused, Batch::Blocks(_)));
    let found = weighted(model, &fused, &objective);
    let objective = objective.composed();
    let composed = objective.all(segments, &model.device());
    assert!(matches!(composed, Batch::Columns(_)));
    let wanted = weighted(model, &composed, &objective);
    for (found, wanted) in found.loss.iter().zip(wanted.loss) {
        assert!((found - wanted).abs() <= 1e-5 * wanted, "{found} {wanted}");
    }
    let (found, wanted) = (found.by_numbers, wanted.by_numbers);
    assert_eq!(found.len(), wanted.len());
    // The physical parameters and the networks separately, as their slopes differ in size.
    let parameters = model.declared().len();
    for part in [0..parameters, parameters..wanted.len()] {
        let (found, wanted) = (&found[part.clone()], &wanted[part]);
        let off = norm(found.iter().zip(wanted).map(|(a, b)| a - b));
        let size = norm(wanted.iter().copied());
        assert!(
            off <= 1e-5 * size,
            "off by {off} of {size}, {integrator:?}, {model:?}"
        );
    }
}

#[test]
fn the_fused_loss_is_the_composed_one_for_every_model_and_integrator() {
    for joints in [1, 2] {
        for steps in [1, 3] {
            let segments = segments(joints, 37, steps);
            for model in models(joints, &Backend::NdArray.device()) {
                for integrator in Integrator::each() {
                    assert_agrees(&model, &segments, integrator);
                }
            }
        }
    }
}

#[test]
fn batches_of_every_size_agree() {
    for size in [1, 31, 32, 33, 128, 257, 1000] {
        let segments = transitions(size, -0.5, 1);
        let model = hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Random);
        assert_agrees(&model, &segments, Integrator::default());
    }
}

#[test]
fn gradient_checkpointing_does_not_change_the_gradients() {
    let segments = segments(1, 40, 2);
    for model in models(1, &Backend::NdArray.device().gradient_checkpointing()) {
        assert_agrees(&model, &segments, Integrator::RK4);
    }
}

#[test]
fn equations_without_parameters_can_have_a_residual() {
    let segments = segments(1, 40, 2);
    let dynamics = one_joint("9.81 * sin(q1)", Vec::new());
    let residual = network(1, Angles::Raw, ResidualOn::Accelerations, 7);
    let model = hybrid_of(&dynamics, &residual, &Backend::NdArray.device());
    assert_agrees(&model, &segments, Integrator::RK4);
}

#[test]
fn a_diverging_rollout_makes_the_loss_infinite_or_nan() {
    let segments = segments(1, 40, 3);
    let dynamics = one_joint("C * exp(1000 * q1 * q1)", vec![parameter("C", 3.0)]);
    let residual = network(1, Angles::Raw, ResidualOn::Accelerations, 7);
    let model = HybridModel::physics(&dynamics, &Backend::NdArray.device()).unwrap();
    let objective = Objective::new(Integrator::RK4, None, 1).unwrap();
    let batch = objective.all(&segments, &model.device());
    for model in [model.clone(), model.with_residual(&residual).unwrap()] {
        let [error, _] = objective.evaluate(&model, &batch);
        assert!(!error.is_finite(), "{error}");
    }
}

#[test]
fn the_same_run_twice_has_the_same_bits() {
    let segments = transitions(777, -0.5, 1);
    let run = || {
        let model = hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Random);
        let settings = epochs(50);
        fit(model, &segments, settings).model().weights()
    };
    let first = run();
    for _ in 0..3 {
        assert_eq!(run(), first);
    }
}

#[test]
fn fused_and_composed_runs_reach_the_same_error() {
    let segments = transitions(500, -0.5, 1);
    let model = hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Zero);
    let settings = epochs(300);
    let mut composed = Training::new(model.clone(), settings.clone(), rng(3)).unwrap();
    composed.objective = composed.objective.composed();
    run(&mut composed, &segments);
    let composed = composed.history().last().unwrap().clone();
    let training = fit(model, &segments, settings);
    let fused = training.history().last().unwrap();
    // Rounding grows over 300 steps of Adam to some 1e-3.
    assert!(
        (fused.error / composed.error - 1.0).abs() < 0.02,
        "{fused:?} {composed:?}"
    );
    for (a, b) in fused.parameters.iter().zip(&composed.parameters) {
        assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
    }
}
