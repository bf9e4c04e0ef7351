//! Optimisers and schedules by name.

use std::num::NonZeroUsize;

use super::{fit, hybrid, hybrid_of, one_joint, parameter, rng, transitions};
use crate::{
    Backend, Batching, FitSettings, HybridModel, LearningRates, OptimizerKind, Penalty, Schedule,
    Training,
};
use residyn_core::model::LastLayer;

fn settings(optimizer: OptimizerKind) -> FitSettings {
    FitSettings {
        epochs: 60,
        optimizer,
        learning_rates: LearningRates {
            physics: 1e-3,
            prior: 1e-3,
            residual: 1e-3,
        },
        record_every: NonZeroUsize::new(60).unwrap(),
        ..FitSettings::default()
    }
}

#[test]
fn every_optimiser_lowers_the_loss() {
    let segments = transitions(200, -0.5, 1);
    let model = hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Zero);
    for optimizer in OptimizerKind::ALL {
        let run = fit(model.clone(), &segments, settings(optimizer));
        let [before, after] = [0, 1].map(|k| run.history()[k].error);
        assert!(after < before, "{optimizer:?}: {before} {after}");
    }
}

#[test]
fn every_optimiser_is_known_by_its_name() {
    let refused = serde_json::from_str::<OptimizerKind>("\"none\"").unwrap_err();
    let names = OptimizerKind::ALL.map(|kind| format!("`{}`", kind.name()));
    let known = format!("expected one of {}", names.join(", "));
    assert!(refused.to_string().contains(&known), "{refused}");
}

#[test]
fn what_has_no_decoupled_decay_says_which_have() {
    let segments = transitions(20, -0.5, 1);
    let model = hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Zero);
    let refusal = |optimizer: OptimizerKind| {
        let decaying = FitSettings {
            weight_decay: 0.1,
            ..settings(optimizer)
        };
        Training::new(model.clone(), decaying, rng(3)).err()
    };
    let (refused, accepted): (Vec<_>, Vec<_>) =
        (OptimizerKind::ALL.into_iter()).partition(|kind| refusal(*kind).is_some());
    assert!(accepted.contains(&OptimizerKind::Adam));
    let names: Vec<String> = accepted.into_iter().map(OptimizerKind::name).collect();
    for kind in refused {
        let message = refusal(kind).unwrap().to_string();
        let words = [format!("and {} has no", kind.name()), names.join(", ")];
        assert!(
            words.iter().all(|words| message.contains(words)),
            "{message}"
        );
    }
    assert!(refusal(OptimizerKind::Sgd).is_some());
}

/// How far a model's single parameter has moved after each epoch of sign gradient descent (Lion, first step).
fn rates(schedule: Schedule) -> Vec<f64> {
    let segments = transitions(20, 0.0, 1);
    let dynamics = one_joint("C_g * sin(q1) + 3 * tau1", vec![parameter("C_g", 8.0)]);
    let model = HybridModel::physics(&dynamics, &Backend::NdArray.device()).unwrap();
    let settings = FitSettings {
        epochs: 5,
        optimizer: OptimizerKind::Lion,
        anneal: 0.0625,
        schedule,
        record_every: NonZeroUsize::MIN,
        ..FitSettings::default()
    };
    let run = fit(model, &segments, settings);
    let values: Vec<f64> = run.history().iter().map(|r| r.parameters[0]).collect();
    let first = values[1] - values[0];
    values
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) / first)
        .collect()
}

#[test]
fn learning_rates_follow_their_schedule() {
    for (schedule, wanted) in [
        (Schedule::Exponential, [1.0, 0.5, 0.25, 0.125, 0.0625]),
        (Schedule::Linear, [1.0, 0.765625, 0.53125, 0.296875, 0.0625]),
        (Schedule::Cosine, [1.0, 0.862707, 0.53125, 0.199793, 0.0625]),
    ] {
        for (found, wanted) in rates(schedule).into_iter().zip(wanted) {
            assert!(
                (found - wanted).abs() < 1e-3,
                "{schedule:?}: {found} {wanted}"
            );
        }
    }
}

#[test]
fn minibatches_and_bounds_act_with_either_penalty() {
    let segments = transitions(50, -0.5, 1);
    let mut c_i = parameter("C_i", 2.0);
    c_i.bounds = [0.0, 2.05];
    let dynamics = one_joint(
        "C_g * sin(q1) + C_i * tau1",
        vec![parameter("C_g", 8.0), c_i],
    );
    let residual = hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Zero);
    let residual = residual.weights().residual.unwrap();
    let model = hybrid_of(&dynamics, &residual, &Backend::NdArray.device());
    let mini = Batching::Mini {
        size: NonZeroUsize::new(16).unwrap(),
    };
    let adaptive = Penalty::Adaptive {
        initial: 1.0,
        rate: 10.0,
    };
    for (batching, penalty) in [(Batching::Full, adaptive), (mini, Penalty::default())] {
        let settings = FitSettings {
            epochs: 30,
            batching,
            penalty,
            ..FitSettings::default()
        };
        let run = fit(model.clone(), &segments, settings);
        assert!((run.model().weights().parameters[1] - 2.05).abs() < 1e-6);
    }
}
