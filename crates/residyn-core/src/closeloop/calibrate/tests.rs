//! Tests on a simulated pendulum without a missing effect, with encoders as on a real rig.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::closeloop::tests::{Study, pendulum, recorded};
use crate::data::Log;

const RIG: &str = r#"
model = "pendulum"
parameters = { C_g = -17.4, C_i = 4.6 }
sensor = { rate_hz = 100, position_noise = 5e-4, position_step = 1.5339807878856412e-3 }
excitation = { amplitude = [1.6], band_hz = [0.15, 2.0], tones = 8 }
recording = { logs = 3, duration_s = 8, start = [0, 0] }
"#;

/// A study of the rig without friction.
fn study() -> Study {
    Study::of(pendulum(), RIG)
}

/// Logs of the rig with this level of dry friction.
fn with_friction(level: f64, seed: u64) -> Vec<Log> {
    let effect = format!("{{ name = \"coulomb_friction\", joint = 1, F_c = {level} }}");
    recorded(&format!("{RIG}effect = [{effect}]"), seed)
}

#[test]
fn simulated_logs_have_the_windows_of_the_original_logs() {
    let study = study();
    let declared = study.closed().fit_declared().unwrap();
    let (problem, accepted) = (declared.problem, declared.fitted);
    let simulated = SimulatedLogs::new(&problem, &accepted).unwrap();
    let rng = &mut ChaCha8Rng::seed_from_u64(0);
    let drawn = simulated.draw(&[], rng).unwrap();
    let again = problem.on(&drawn);
    let (before, after) = (&problem.shooting, &again.shooting);
    assert_eq!(before.windows.len(), after.windows.len());
    // The motion is the accepted model's, and each residual has its old size: only signs were drawn.
    let residuals = |problem: &Problem<'_>| {
        // What the rows of a neighbouring window say about a start state has that window's sign.
        let windows = problem.shooting.windows.clone();
        let shooting = problem.shooting.over(windows).with_free_starts();
        let states = shooting.initial_start_states(0);
        let scale = Some(accepted.fit.scale);
        let dynamics = &accepted.model.dynamics();
        let (values, found) =
            crate::identify::fit(&shooting, dynamics, &[], states, scale).unwrap();
        shooting.residuals(dynamics, &values, &found.start_states)
    };
    let mut turned = 0;
    let both = residuals(&problem).into_iter().zip(residuals(&again));
    for (window, (old, new)) in both.enumerate() {
        let sign = old
            .iter()
            .zip(&new)
            .map(|(a, b)| a * b)
            .sum::<f64>()
            .signum();
        turned += usize::from(sign < 0.0);
        let off = old.iter().zip(&new).map(|(a, b)| (a - sign * b).abs());
        let off = off.fold(0.0, f64::max);
        // Both fits end when a step gains less than 1e-4 of the loss.
        assert!(off < 1e-3, "window {window}: {off}");
    }
    assert!(turned > 5 && turned < after.windows.len() - 5, "{turned}");
}

#[test]
fn complete_models_raise_no_false_alarm_and_hidden_effects_are_named() {
    let study = study();
    let declared = study.fitted();
    let (problem, accepted) = (declared.problem, declared.fitted);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let calibrator = Calibrator::new(&problem, &accepted, 8, &mut rng).unwrap();
    let search = |simulation| calibrator.search(simulation, &()).unwrap();
    let searched = calibrator.simulations().iter().map(search).collect();
    let found = calibrator.conclude(searched);
    // At the nominal 5 %, two alarms in eight have a probability of 6 %, three one of 0.6 %.
    assert!(found.alarms() <= 2, "{:?}", found.named);
    let limits = found.limits.iter();
    let tried: Vec<_> = limits.filter_map(DetectionLimit::verified).collect();
    // The drive's gain cannot be distinguished from the pendulum's constants.
    assert_eq!(tried, [true; 3]);
    let gain = |limit: &&DetectionLimit| limit.effect.effect.name == "actuator_gain";
    let gain = found.limits.iter().find(gain).unwrap();
    assert_eq!(gain.smallest, Smallest::Indistinguishable);
}

#[test]
fn friction_is_named_above_its_detection_limit() {
    const SEEDS: u64 = 4;
    let study = study();
    let bare = study.fitted();
    let limits = detection_limits(&bare.problem, &bare.fitted).unwrap();
    let friction = |limit: &&DetectionLimit| limit.effect.effect.name == "coulomb_friction";
    let Smallest::Detectable { values, .. } = &limits.iter().find(friction).unwrap().smallest
    else {
        panic!("friction shows in any motion");
    };
    let smallest = values[0];
    let named = |level: f64| {
        let named = |seed: &u64| {
            let logs = with_friction(level, 100 + seed);
            let Study {
                declared,
                library,
                settings,
                ..
            } = &study;
            let problem = Problem::new(declared, library, &logs, settings);
            let rng = &mut ChaCha8Rng::seed_from_u64(*seed);
            let found = find(problem.fit_declared().unwrap(), &[], rng, &()).unwrap();
            let labels = found.chosen.named().map(FittedEffect::label);
            labels.collect::<Vec<_>>() == ["coulomb_friction on joint 1"]
        };
        (0..SEEDS).filter(named).count()
    };
    assert!(named(0.5 * smallest) <= 1, "half of {smallest}");
    assert!(named(2.0 * smallest) >= 3, "twice {smallest}");
}
