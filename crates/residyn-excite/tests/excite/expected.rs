//! Expected intervals and evidence are those of fits to simulated logs with noise.

use crate::support::{arm_limits, effect, joint, limits, model, with};
use rand_distr::{Distribution, Normal};
use residyn_core::data::Log;
use residyn_core::identify::{LevenbergMarquardt, Shooting, cut, fit, fit_torques};
use residyn_core::model::Model;
use residyn_core::rng;
use residyn_excite::{Compared, Design, Limits, Settings, design};

const SEEDS: u64 = 20;

/// The log that the rig gives under a design, with the noise of its sensors.
fn measured(design: &Design, rig: &Model, limits: &Limits, seed: u64) -> Log {
    let mut log = design.recorded_by(rig).unwrap();
    let mut rng = rng(seed);
    for (joint, own) in limits.joints.iter().enumerate() {
        let angle = Normal::new(0.0, own.encoder_noise).unwrap();
        let torque = Normal::new(0.0, own.torque_noise).unwrap();
        log.q[joint]
            .iter_mut()
            .for_each(|q| *q += angle.sample(&mut rng));
        if design.compared == Compared::Torques {
            log.tau[joint]
                .iter_mut()
                .for_each(|tau| *tau += torque.sample(&mut rng));
        }
    }
    log
}

/// The parameters that the core's fit finds in a log.
fn fitted(model: &Model, log: Log, limits: &Limits, compared: Compared) -> Model {
    let logs = [log];
    if compared == Compared::Torques {
        return fit_torques(&LevenbergMarquardt::USUAL, model, model, &logs)
            .unwrap()
            .model;
    }
    let noise: Vec<f64> = limits
        .joints
        .iter()
        .map(|joint| joint.encoder_noise)
        .collect();
    let shooting = Shooting::new(&logs, cut(&logs, 0.5), &noise);
    let dynamics = model.dynamics();
    let active: Vec<usize> = (0..dynamics.parameters.len())
        .filter(|k| !dynamics.parameters[*k].fixed)
        .collect();
    let starts = shooting.initial_start_states(0);
    let (values, _) = fit(&shooting, &dynamics, &active, starts, None).unwrap();
    model.at(&values.put_into(&dynamics, &logs))
}

/// For each sum of parameters the scatter of its estimates over the expected standard deviation, and their mean's distance
/// from the true value in expected standard deviations.
fn ratios(model: &Model, limits: &Limits, duration_s: f64) -> Vec<(String, f64, f64)> {
    let settings = Settings {
        starts: 4,
        ..Settings::default()
    };
    let design = design(model, &[], limits, duration_s, &settings, 1, &|_| ()).unwrap();
    let found: Vec<Model> = (0..SEEDS)
        .map(|seed| {
            fitted(
                model,
                measured(&design, model, limits, seed),
                limits,
                design.compared,
            )
        })
        .collect();
    let value = |model: &Model, name: &str| {
        let all = model.all_parameters();
        all.iter()
            .find(|parameter| parameter.name == name)
            .unwrap()
            .value
    };
    (design.expected.iter())
        .map(|expected| {
            let sum = |model: &Model| -> f64 {
                expected
                    .sum
                    .parts
                    .iter()
                    .map(|(name, weight)| weight * value(model, name))
                    .sum()
            };
            let estimates: Vec<f64> = found.iter().map(sum).collect();
            let mean = estimates.iter().sum::<f64>() / SEEDS as f64;
            let squares = estimates.iter().map(|estimate| (estimate - mean).powi(2));
            let scatter = (squares.sum::<f64>() / (SEEDS - 1) as f64).sqrt();
            let name = expected.sum.parts[0].0.clone();
            (
                name,
                scatter / expected.deviation,
                (mean - sum(model)) / expected.deviation,
            )
        })
        .collect()
}

fn assert_true(model: &Model, limits: &Limits) {
    for (name, ratio, off) in ratios(model, limits, 10.0) {
        println!(
            "{} {name}: scatter {ratio:.2} of the expected deviation, mean off by {off:.2}",
            model.name
        );
        assert!((1.0 / 1.5..1.5).contains(&ratio), "{name}: {ratio}");
    }
}

#[test]
fn one_joint_scatters_as_expected_by_its_angles() {
    assert_true(&model("pendulum"), &limits(vec![joint([-1.0, 1.0], 8.0)]));
}

#[test]
fn one_joint_scatters_as_expected_by_its_torques() {
    let model = with(&model("drive"), effect("viscous_friction", 1, &[0.4]));
    let model = with(&model, effect("coulomb_friction", 1, &[0.5]));
    assert_true(&model, &limits(vec![joint([-0.5, 0.5], 12.0)]));
}

#[test]
fn a_position_loop_scatters_as_expected() {
    let mut limits = limits(vec![joint([-1.0, 1.0], 1.8)]);
    limits.joints[0].encoder_noise = 1e-3;
    assert_true(&model("servo"), &limits);
}

#[test]
fn two_joints_scatter_as_expected_by_their_torques() {
    assert_true(&model("acrobot"), &arm_limits(2, 60.0));
}

/// Twice the logarithm of the likelihood ratio exceeds its expectation without an effect, the number of rows beyond the free
/// values, by the expected evidence.
#[test]
fn evidence_is_what_a_fit_leaves() {
    let limits = limits(vec![joint([-1.0, 1.0], 8.0)]);
    let base = model("pendulum");
    let rig = with(&base, effect("coulomb_friction", 1, &[0.004]));
    let settings = Settings {
        starts: 4,
        ..Settings::default()
    };
    let design = design(
        &base,
        std::slice::from_ref(&rig),
        &limits,
        10.0,
        &settings,
        1,
        &|_| (),
    )
    .unwrap();
    let noise = limits.joints[0].encoder_noise;
    let left = |rig: &Model, seed: u64| -> f64 {
        let logs = [measured(&design, rig, &limits, seed)];
        let shooting = Shooting::new(&logs, cut(&logs, 0.5), &[noise]).with_free_starts();
        let dynamics = base.dynamics();
        let starts = shooting.initial_start_states(0);
        let (values, found) = fit(&shooting, &dynamics, &[0, 1], starts, Some(1e6)).unwrap();
        let residuals = shooting.residuals(&dynamics, &values, &found.start_states);
        residuals
            .iter()
            .flatten()
            .map(|residual| residual.powi(2))
            .sum()
    };
    let more: f64 = (0..SEEDS)
        .map(|seed| left(&rig, seed) - left(&base, seed))
        .sum();
    let ratio = more / SEEDS as f64 / design.evidence[0];
    println!(
        "evidence {:.1}, found over expected {ratio:.2}",
        design.evidence[0]
    );
    assert!(
        (1.0 / 1.5..1.5).contains(&ratio),
        "{ratio} {}",
        design.evidence[0]
    );
}

#[test]
fn an_alternative_that_the_parameters_explain_has_no_evidence() {
    let base = with(&model("acrobot"), effect("viscous_friction", 1, &[0.3]));
    let contained = with(&model("acrobot"), effect("viscous_friction", 1, &[0.5]));
    let another = with(&base, effect("coulomb_friction", 2, &[0.3]));
    let bristly = with(&base, effect("presliding", 2, &[0.3, 20.0]));
    let all = [contained, another, bristly];
    let settings = Settings {
        starts: 2,
        steps: 20,
        ..Settings::default()
    };
    let limits = arm_limits(2, 60.0);
    let plain = design(&base, &[], &limits, 6.0, &settings, 1, &|_| ()).unwrap();
    let found = design(&base, &all[1..], &limits, 6.0, &settings, 1, &|_| ()).unwrap();
    assert!(
        found.evidence.iter().all(|evidence| *evidence > 1.0),
        "{:?}",
        found.evidence
    );
    let told = design(&base, &all[..1], &limits, 6.0, &settings, 1, &|_| ()).unwrap();
    assert!(told.evidence[0] < 1e-6, "{:?}", told.evidence);
    assert!(plain.evidence.is_empty());
}
