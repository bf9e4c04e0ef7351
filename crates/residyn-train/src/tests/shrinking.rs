//! Weight decay and decreasing learning rates.

use super::{epochs, fit, hybrid, rng, transitions};
use crate::{Backend, FitSettings, HybridModel, LearningRates, Training};
use residyn_core::model::{LastLayer, MlpWeights};

fn after(model: &HybridModel, settings: FitSettings) -> HybridModel {
    let training = fit(model.clone(), &transitions(20, -0.5, 1), settings);
    training.result().unwrap()
}

fn residual(model: &HybridModel) -> Vec<f64> {
    model.weights().residual.unwrap().flat()
}

#[test]
fn weight_decay_applies_to_weights_and_not_to_physical_parameters() {
    let segments = transitions(20, -0.5, 1);
    let model = hybrid((14.0, 3.5), &segments, Backend::NdArray, LastLayer::Random);
    let decaying = FitSettings {
        weight_decay: 2.0,
        ..epochs(1)
    };
    let (with, without) = (after(&model, decaying), after(&model, epochs(1)));
    let numbers = residual(&with)
        .into_iter()
        .zip(residual(&without))
        .zip(residual(&model));
    for ((with, without), before) in numbers {
        // Adam's step is the same; 0.01 * 2 of the number before it is gone.
        let expected = without - 0.02 * before;
        assert!((with - expected).abs() < 1e-6, "{with} {expected}");
    }
    assert_eq!(with.parameters(), without.parameters());
}

#[test]
fn weight_decay_does_not_apply_to_a_prior_below_a_residual() {
    let segments = transitions(20, -0.5, 1);
    let device = Backend::NdArray.device();
    let network: MlpWeights = hybrid((14.0, 3.5), &segments, Backend::NdArray, LastLayer::Random)
        .weights()
        .residual
        .unwrap();
    let alone = HybridModel::network("pendulum", 1, &network, &device).unwrap();
    let both = alone.clone().with_residual(&network).unwrap();
    let decaying = FitSettings {
        weight_decay: 2.0,
        learning_rates: LearningRates {
            prior: 1e-9,
            ..LearningRates::default()
        },
        ..epochs(1)
    };
    let prior = |model: &HybridModel| model.weights().prior.unwrap().flat();
    let still = prior(&after(&both, decaying.clone()));
    assert!(
        still
            .iter()
            .zip(prior(&both))
            .all(|(a, b)| (a - b).abs() < 1e-7)
    );
    let fast = FitSettings {
        learning_rates: LearningRates::default(),
        ..decaying
    };
    let shrunk = |model: &HybridModel, settings: &FitSettings| {
        let plain = FitSettings {
            weight_decay: 0.0,
            ..settings.clone()
        };
        let (with, without) = (after(model, settings.clone()), after(model, plain));
        prior(&with)
            .iter()
            .zip(prior(&without))
            .any(|(a, b)| (a - b).abs() > 1e-4)
    };
    assert!(shrunk(&alone, &fast) && !shrunk(&both, &fast));
}

#[test]
fn learning_rates_fall_from_one_to_the_annealed_share() {
    let segments = transitions(20, -0.5, 1);
    let model = hybrid((14.0, 3.5), &segments, Backend::NdArray, LastLayer::Random);
    let falling = FitSettings {
        anneal: 1e-9,
        ..epochs(2)
    };
    // The first step is taken at the full rate, the last at a billionth.
    let (two, one) = (after(&model, falling), after(&model, epochs(1)));
    let off = residual(&two)
        .into_iter()
        .zip(residual(&one))
        .map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-7);
    let message = Training::new(
        model,
        FitSettings {
            anneal: 1.5,
            ..epochs(2)
        },
        rng(2),
    );
    let message = message.err().unwrap().to_string();
    assert!(message.starts_with("setting `anneal` is 1.5"), "{message}");
}
