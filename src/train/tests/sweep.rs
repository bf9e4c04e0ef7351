//! A model of a sweep against the same model trained alone.

use std::num::NonZeroUsize;

use super::fused::{equations, network, segments};
use super::{hybrid_of, one_joint, parameter, rng, run, transitions};
use crate::model::{Angles, LastLayer, ResidualOn};
use crate::sim::Integrator;
use crate::train::stacked::StackedSweep;
use crate::train::{
    Backend, Batching, FitSettings, HybridModel, Penalty, Segments, Sweep, Trained, Variant,
};

fn settings() -> FitSettings {
    FitSettings {
        epochs: 30,
        ..FitSettings::default()
    }
}

/// Networks and penalties of their own, drawn as `model`'s network was.
fn variants(model: &HybridModel, last: LastLayer) -> Vec<Variant> {
    let made = model.structure().networks.last().unwrap();
    let variant = |seed: u64| Variant {
        network: made.redrawn(last, &mut rng(seed)),
        penalty_weight: [1e-4, 1e-2, 0.3][seed as usize],
        order: rng(100 + seed),
    };
    (0..3).map(variant).collect()
}

fn sweep(
    model: &HybridModel,
    settings: &FitSettings,
    variants: &[Variant],
    on: &Segments,
) -> Vec<Trained> {
    let mut sweep = StackedSweep::new(model, settings.clone(), variants.to_vec()).unwrap();
    sweep.run(on, &mut |_| ()).unwrap()
}

/// The variant trained alone by the composed loss, as the sweep's.
fn alone(model: &HybridModel, settings: &FitSettings, variant: &Variant, on: &Segments) -> Trained {
    let sweep = Sweep::new(model, settings.clone(), vec![variant.clone()]).unwrap();
    let mut training = sweep.training(variant).unwrap();
    training.objective = training.objective.composed();
    run(&mut training, on);
    Trained::of(&training)
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
fn a_model_of_a_sweep_is_trained_as_if_alone() {
    for &backend in Backend::ALL {
        for (joints, steps) in [(1, 1), (1, 3), (2, 1), (2, 3)] {
            let segments = segments(joints, 37, steps);
            let network = |on| network(joints, Angles::SinCos, on, 7);
            let residual = network(ResidualOn::Derivative);
            let hybrid = hybrid_of(&equations(joints), &residual, &backend.device());
            let prior = network(ResidualOn::Accelerations);
            let data_driven =
                HybridModel::network("system", joints, &prior, &backend.device()).unwrap();
            for (model, last) in [(hybrid, LastLayer::Zero), (data_driven, LastLayer::Random)] {
                for integrator in [Integrator::SEMI_IMPLICIT_EULER, Integrator::RK4] {
                    let settings = FitSettings {
                        integrator,
                        ..settings()
                    };
                    let variants = variants(&model, last);
                    let together = sweep(&model, &settings, &variants, &segments);
                    for (variant, found) in variants.iter().zip(&together) {
                        assert_close(found, &alone(&model, &settings, variant, &segments));
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
    let model = hybrid_of(&dynamics, &residual, &backend.device());
    (model, transitions(50, -0.5, 1))
}

/// With the composed loss, as the sweep's: the penalties drive residuals to zero, where their norm is not smooth and Adam
/// amplifies any difference in rounding.
#[test]
fn minibatches_penalties_and_bounds_act_as_in_a_run_of_one_model() {
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
            let settings = FitSettings {
                batching,
                penalty,
                ..settings()
            };
            let mut variants = variants(&model, LastLayer::Zero);
            if penalty == adaptive {
                // Far enough from zero, where the norm of the residual is not smooth.
                variants
                    .iter_mut()
                    .for_each(|variant| variant.penalty_weight *= 1000.0);
            }
            let together = sweep(&model, &settings, &variants, &segments);
            for (variant, found) in variants.iter().zip(&together) {
                let wanted = alone(&model, &settings, variant, &segments);
                let c_i = wanted.parameters[1];
                assert!((c_i - 2.05).abs() < 1e-6, "{wanted:?}");
                assert_close(found, &wanted);
            }
        }
    }
}

#[test]
fn a_diverging_model_does_not_change_the_others() {
    for &backend in Backend::ALL {
        let (model, segments) = bounded(backend);
        let sound = variants(&model, LastLayer::Random);
        let wanted = sweep(&model, &settings(), &sound, &segments);
        for wrong in [1e30, f64::NAN] {
            let mut variants = sound.clone();
            variants[1].network.layers[0].weight.fill(wrong);
            let found = sweep(&model, &settings(), &variants, &segments);
            assert!(found[1].diverged && !found[1].error.is_finite());
            assert_eq!(found[1].parameters, [8.0, 2.0]);
            assert_eq!([&found[0], &found[2]], [&wanted[0], &wanted[2]]);
        }
    }
}

#[test]
fn segments_of_other_joints_are_refused() {
    let (model, _) = bounded(Backend::NdArray);
    let variants = variants(&model, LastLayer::Zero);
    let sweep = Sweep::new(&model, settings(), variants).unwrap();
    let message = sweep.run(&segments(2, 5, 1), &mut |_| ()).unwrap_err();
    assert!(message.to_string().contains("2 joints"), "{message}");
}

#[test]
fn equations_without_parameters_can_have_a_residual() {
    let segments = segments(1, 20, 1);
    let residual = network(1, Angles::Raw, ResidualOn::Accelerations, 7);
    for &backend in Backend::ALL {
        let dynamics = one_joint("9.81 * sin(q1)", Vec::new());
        let model = hybrid_of(&dynamics, &residual, &backend.device());
        let variants = variants(&model, LastLayer::Zero);
        let together = sweep(&model, &settings(), &variants, &segments);
        for (variant, found) in variants.iter().zip(&together) {
            assert_close(found, &alone(&model, &settings(), variant, &segments));
        }
    }
}
