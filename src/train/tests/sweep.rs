//! A model of a sweep against the same model trained alone.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use super::fused::{equations, network, segments};
use super::{one_joint, parameter, rng, transitions};
use crate::model::{Angles, LastLayer, ResidualOn};
use crate::sim::Integrator;
use crate::train::optimizer::Stepper;
use crate::train::{
    Backend, Batch, Batching, FitSettings, HybridModel, Objective, Penalty, Segments, Start, Sweep,
    Trained, Training,
};

const BACKENDS: &[Backend] = Backend::ALL;

fn settings() -> FitSettings {
    FitSettings {
        epochs: 30,
        ..FitSettings::default()
    }
}

/// Networks and penalties of their own, drawn as `model`'s network was.
fn starts(model: &HybridModel, last: LastLayer) -> Vec<Start> {
    let made = model.frame().networks.last().unwrap();
    let start = |seed: u64| Start {
        network: made.redrawn(last, &mut rng(seed)),
        penalty_weight: [1e-4, 1e-2, 0.3][seed as usize],
        order: rng(100 + seed),
    };
    (0..3).map(start).collect()
}

fn sweep(
    model: &HybridModel,
    settings: &FitSettings,
    starts: &[Start],
    on: &Segments,
) -> Vec<Trained> {
    let mut sweep = Sweep::new(model, settings.clone(), starts.to_vec()).unwrap();
    sweep.run(on, &mut |_| ()).unwrap()
}

/// `model` with the start's network.
fn begun(model: &HybridModel, start: &Start) -> HybridModel {
    let mut weights = model.weights();
    match &mut weights.residual {
        Some(residual) => *residual = start.network.clone(),
        None => weights.prior = Some(start.network.clone()),
    }
    model.with_weights(&weights).unwrap()
}

/// The start trained alone by the composed loss, on all segments at once.
fn alone(model: &HybridModel, settings: &FitSettings, start: &Start, on: &Segments) -> Trained {
    let mut model = begun(model, start);
    let all: Vec<usize> = (0..on.len()).collect();
    let batch = Batch::Columns(on.columns(&all, &model.device()));
    let objective = Objective::new(settings.integrator, None, model.joints()).unwrap();
    let mut optimizer = Stepper::new(model.frame(), settings);
    let has_residual = model.frame().has_residual;
    let weights = settings.penalty.weights(start.penalty_weight, has_residual);
    for _ in 0..settings.epochs {
        let loss = objective.loss(&model, &batch).weighted(weights);
        let stepped = optimizer.step(model.tensors(), loss.backward());
        model = model.with_tensors(stepped).project();
    }
    let [error, residual_norm] = objective.loss(&model, &batch).numbers();
    Trained {
        error,
        residual_norm,
        parameters: model.weights().parameters,
        diverged: false,
    }
}

/// Products in another order leave some 1e-7 after one step, which thirty steps of Adam carry on.
fn assert_close(found: &Trained, wanted: &Trained) {
    assert!(!found.diverged);
    let numbers = |trained: &Trained| {
        let mut all = vec![trained.error, trained.residual_norm];
        all.extend(&trained.parameters);
        all
    };
    for (found, wanted) in numbers(found).into_iter().zip(numbers(wanted)) {
        assert!(
            (found - wanted).abs() <= 1e-4 * wanted.abs(),
            "{found}, alone {wanted}"
        );
    }
}

#[test]
fn every_model_is_as_trained_alone() {
    for &backend in BACKENDS {
        for (joints, steps) in [(1, 1), (1, 3), (2, 1), (2, 3)] {
            let segments = segments(joints, 37, steps);
            let network = |on| network(joints, Angles::SinCos, on, 7);
            let residual = network(ResidualOn::Derivative);
            let hybrid = HybridModel::physics(&equations(joints), &backend.device())
                .and_then(|model| model.with_residual(&residual))
                .unwrap();
            let prior = network(ResidualOn::Accelerations);
            let data_driven =
                HybridModel::network("system", joints, &prior, &backend.device()).unwrap();
            for (model, last) in [(hybrid, LastLayer::Zero), (data_driven, LastLayer::Random)] {
                for integrator in [Integrator::SEMI_IMPLICIT_EULER, Integrator::RK4] {
                    let settings = FitSettings {
                        integrator,
                        ..settings()
                    };
                    let starts = starts(&model, last);
                    let together = sweep(&model, &settings, &starts, &segments);
                    for (start, found) in starts.iter().zip(&together) {
                        assert_close(found, &alone(&model, &settings, start, &segments));
                    }
                }
            }
        }
    }
}

/// A pendulum on its transitions, with a bound that C_i would cross.
fn bounded(backend: Backend) -> (HybridModel, Segments) {
    let mut c_i = parameter("C_i", 2.0);
    c_i.bounds = [0.0, 2.05];
    let dynamics = one_joint(
        "C_g * sin(q1) + C_i * tau1",
        vec![parameter("C_g", 8.0), c_i],
    );
    let residual = network(1, Angles::Raw, ResidualOn::Derivative, 7);
    let model = HybridModel::physics(&dynamics, &backend.device())
        .and_then(|model| model.with_residual(&residual))
        .unwrap();
    (model, transitions(50, -0.5, 1))
}

/// With the composed loss, as the sweep: the penalties drive residuals to zero, where their norm is not smooth and Adam
/// would let the smallest difference in rounding grow.
#[test]
fn minibatches_penalties_and_bounds_are_those_of_a_run_alone() {
    let (model, segments) = bounded(Backend::NdArray);
    let mini = Batching::Mini {
        size: NonZeroUsize::new(16).unwrap(),
    };
    let adaptive = Penalty::Adaptive {
        initial: 1.0,
        rate: 10.0,
    };
    for batching in [Batching::Full, mini] {
        for penalty in [Penalty::default(), adaptive] {
            let of = |weight| FitSettings {
                batching,
                penalty: match penalty {
                    Penalty::Fixed { .. } => Penalty::Fixed { alpha: weight },
                    Penalty::Adaptive { rate, .. } => Penalty::Adaptive {
                        initial: weight,
                        rate,
                    },
                },
                ..settings()
            };
            let mut starts = starts(&model, LastLayer::Zero);
            if penalty == adaptive {
                // Far enough from zero, where the norm of the residual is not smooth.
                starts
                    .iter_mut()
                    .for_each(|start| start.penalty_weight *= 1000.0);
            }
            let together = sweep(&model, &of(1.0), &starts, &segments);
            for (start, found) in starts.into_iter().zip(&together) {
                let model = begun(&model, &start);
                let run = Training::new(model, of(start.penalty_weight), start.order);
                let mut run = run.unwrap().composed();
                run.run(&segments, None, &mut |_| ControlFlow::Continue(()))
                    .unwrap();
                let last = run.history().last().unwrap();
                assert!((last.parameters[1] - 2.05).abs() < 1e-6, "{last:?}");
                let wanted = Trained {
                    error: last.error,
                    residual_norm: last.residual_norm,
                    parameters: last.parameters.clone(),
                    diverged: false,
                };
                assert_close(found, &wanted);
            }
        }
    }
}

#[test]
fn a_model_that_diverges_leaves_the_others_as_they_are() {
    for &backend in BACKENDS {
        let (model, segments) = bounded(backend);
        let sound = starts(&model, LastLayer::Random);
        let wanted = sweep(&model, &settings(), &sound, &segments);
        for wrong in [1e30, f64::NAN] {
            let mut starts = sound.clone();
            starts[1].network.layers[0].weight.fill(wrong);
            let found = sweep(&model, &settings(), &starts, &segments);
            assert!(found[1].diverged && !found[1].error.is_finite());
            assert_eq!(found[1].parameters, [8.0, 2.0]);
            assert_eq!([&found[0], &found[2]], [&wanted[0], &wanted[2]]);
        }
    }
}

#[test]
fn segments_of_other_joints_are_refused() {
    let (model, _) = bounded(Backend::NdArray);
    let starts = starts(&model, LastLayer::Zero);
    let mut sweep = Sweep::new(&model, settings(), starts).unwrap();
    let message = sweep.run(&segments(2, 5, 1), &mut |_| ()).unwrap_err();
    assert!(message.to_string().contains("2 joints"), "{message}");
}

#[test]
fn equations_without_parameters_can_have_a_residual() {
    let segments = segments(1, 20, 1);
    let residual = network(1, Angles::Raw, ResidualOn::Accelerations, 7);
    for &backend in BACKENDS {
        let dynamics = one_joint("9.81 * sin(q1)", Vec::new());
        let model = HybridModel::physics(&dynamics, &backend.device())
            .and_then(|model| model.with_residual(&residual))
            .unwrap();
        let starts = starts(&model, LastLayer::Zero);
        let together = sweep(&model, &settings(), &starts, &segments);
        for (start, found) in starts.iter().zip(&together) {
            assert_close(found, &alone(&model, &settings(), start, &segments));
        }
    }
}
