use std::ops::ControlFlow;

use super::{epochs, fit, hybrid, hybrid_of, rng, transitions};
use crate::{Backend, FitSettings, HybridModel, LearningRates, Penalty, Segments, Training};
use residyn_core::model::{LastLayer, MlpSettings};

fn assert_near(found: f64, wanted: f64, share: f64) {
    let off = (found - wanted).abs() / wanted.abs();
    assert!(off < share, "{found} is {off} off {wanted}");
}

#[test]
fn the_penalty_separates_physics_from_friction() {
    // Friction -0.5 qd acts in the data only. With alpha = 0 the same run ends at C_g = 13.5, C_i = 2.70;
    // between 1e-5 and 1e-2 within 1 %; from 3e-3 on the residual vanishes.
    for backend in Backend::ALL {
        let segments = transitions(500, -0.5, 1);
        let model = hybrid((8.0, 2.0), &segments, *backend, LastLayer::Zero);
        let training = fit(model, &segments, FitSettings::default());
        let last = training.history().last().unwrap();
        assert_near(last.parameters[0], 15.0, 0.01);
        assert_near(last.parameters[1], 3.0, 0.01);
        // The mean square of qd, uniform within +-8, is 64/3.
        assert_near(last.residual_norm, 0.5 * (64.0_f64 / 3.0).sqrt(), 0.15);
        assert!(last.error < 2e-5, "{}", last.error);
    }
}

#[test]
fn the_adaptive_penalty_recovers_the_same_parameters() {
    let segments = transitions(500, -0.5, 1);
    let model = hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Zero);
    let settings = FitSettings {
        penalty: Penalty::Adaptive {
            initial: 1e3,
            rate: 1e2,
        },
        ..FitSettings::default()
    };
    let training = fit(model, &segments, settings);
    let (first, last) = (&training.history()[0], training.history().last().unwrap());
    assert!(last.penalty_weight > first.penalty_weight);
    assert_near(last.parameters[0], 15.0, 0.01);
    assert_near(last.parameters[1], 3.0, 0.01);
}

#[test]
fn fixed_parameters_and_frozen_parts_do_not_move_and_bounds_hold() {
    let segments = transitions(100, 0.0, 1);
    let mut dynamics = super::pendulum(8.0, 2.0);
    dynamics.parameters[0].fixed = true;
    dynamics.parameters[1].bounds = [0.0, 2.5];
    let device = Backend::NdArray.device();
    let settings = MlpSettings::for_joints(1);
    let mlp = segments.network(&settings, LastLayer::Random, &mut rng(7));
    let model = hybrid_of(&dynamics, &mlp, &device);
    let settings = FitSettings {
        epochs: 200,
        learning_rates: LearningRates {
            residual: 0.0,
            ..LearningRates::default()
        },
        ..FitSettings::default()
    };
    let after = fit(model, &segments, settings).model().weights();
    assert_eq!(after.parameters[0], 8.0);
    assert!((after.parameters[1] - 2.5).abs() < 1e-6, "{after:?}");
    assert_eq!(after.residual, Some(mlp));
}

#[test]
fn a_network_learns_the_dynamics_and_then_serves_as_prior() {
    let segments = transitions(300, 0.0, 1);
    let settings = MlpSettings::for_joints(1);
    let new = |last| segments.network(&settings, last, &mut rng(7));
    let device = Backend::NdArray.device();
    let model = HybridModel::network("pendulum", 1, &new(LastLayer::Random), &device).unwrap();
    let short = epochs(300);
    let offline = fit(model, &segments, short.clone());
    let error = |k: usize, training: &Training| training.history()[k].error;
    assert!(error(3, &offline) < 0.02 * error(0, &offline));

    let prior = offline.model();
    let tuned = prior.with_residual(&new(LastLayer::Zero)).unwrap();
    let tuned = fit(tuned, &transitions(300, -0.5, 2), short);
    assert!(tuned.history()[0].residual_norm < 1e-5);
    assert!(error(3, &tuned) < error(0, &tuned));
}

#[test]
fn the_best_model_by_validation_is_kept_even_the_untrained_one() {
    let segments = transitions(100, 0.0, 1);
    let spoiled = transitions(100, -3.0, 2);
    let model = hybrid((15.0, 3.0), &segments, Backend::NdArray, LastLayer::Zero);
    let start = model.weights();
    let settings = FitSettings {
        epochs: 20,
        record_every: 5.try_into().unwrap(),
        ..FitSettings::default()
    };
    let mut training = Training::new(model, settings, rng(3)).unwrap();
    training
        .run(
            &spoiled,
            Some(&segments),
            &mut |_| ControlFlow::Continue(()),
        )
        .unwrap();
    assert_eq!(training.best.as_ref().unwrap().epoch, 0);
    assert_eq!(training.result().unwrap().weights(), start);
    assert_ne!(training.model().weights(), start);
    assert_eq!(training.history().len(), 5);
}

#[test]
fn a_diverging_loss_stops_the_run_with_epoch_and_remedy() {
    let segments = transitions(50, 0.0, 1);
    let dynamics = super::one_joint(
        "C_g * exp(C_i * exp(abs(qd1) * 100))",
        vec![super::parameter("C_g", 8.0), super::parameter("C_i", 2.0)],
    );
    let model = HybridModel::physics(&dynamics, &Backend::NdArray.device()).unwrap();
    let mut training = Training::new(model, FitSettings::default(), rng(3)).unwrap();
    let error = training.run(&segments, None, &mut |_| ControlFlow::Continue(()));
    assert_eq!(
        error.unwrap_err().to_string(),
        "the loss became inf in epoch 0, with C_g = 8.000000, C_i = 2.000000; look for outliers or wrong \
         units in the data, lower the learning rates, or use shorter segments or a finer integrator"
    );
}

#[test]
fn data_and_settings_that_do_not_fit_are_refused() {
    let segments = transitions(5, 0.0, 1);
    let model = || hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Zero);
    let mut training = Training::new(model(), FitSettings::default(), rng(3)).unwrap();
    let mut run = |segments: &Segments| {
        let ended = training.run(segments, None, &mut |_| ControlFlow::Continue(()));
        ended.unwrap_err().to_string()
    };
    assert_eq!(
        run(&Segments::new(1, 1)),
        "there is nothing to train on; give at least one trajectory"
    );
    let mut two = Segments::new(2, 1);
    two.push_trajectory(&[0.0, 0.1], &[0.0; 8], &[0.0; 4], 1)
        .unwrap();
    assert_eq!(
        run(&two),
        "training segments have 2 joints, but the model of `pendulum` has 1"
    );
    let scaled = FitSettings {
        error_scale: Some(vec![1.0]),
        ..FitSettings::default()
    };
    let refused = Training::new(model(), scaled, rng(3)).err().unwrap();
    assert!(
        refused
            .to_string()
            .starts_with("`error_scale` needs 2 finite numbers")
    );
    let negative = FitSettings {
        penalty: Penalty::Fixed { alpha: -1.0 },
        ..FitSettings::default()
    };
    let refused = Training::new(model(), negative, rng(3)).err().unwrap();
    assert_eq!(
        refused.to_string(),
        "setting `alpha` is -1; it must be finite and not negative"
    );
}
