//! Tests on a simulated pendulum without a missing effect, with encoders as on a real rig.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::closeloop::fit::{Declared, NOTHING};
use crate::closeloop::settings::Settings;
use crate::closeloop::tests::{pendulum, recorded};
use crate::data::Log;
use crate::model::Library;

const RIG: &str = r#"
model = "pendulum"

[parameters]
C_g = -17.4
C_i = 4.6

[sensor]
rate_hz = 100
position_noise = 5e-4
position_step = 1.5339807878856412e-3

[excitation]
amplitude = [1.6]
band_hz = [0.15, 2.0]
tones = 8

[recording]
logs = 3
duration_s = 8
start = [0, 0]
"#;

fn coulomb(level: f64) -> String {
    format!("[[effect]]\nname = \"coulomb_friction\"\njoint = 1\nF_c = {level}\n")
}

/// Logs of the rig, with `more` added to its file.
fn logs(more: &str, seed: u64) -> Vec<Log> {
    recorded(&format!("{RIG}\n{more}"), seed)
}

#[test]
fn simulated_logs_have_the_windows_of_the_original_logs() {
    let (declared, logs) = (pendulum(), logs("", 0));
    let settings = Settings::default();
    let problem = Problem::new(&declared, &NOTHING, &logs, &settings);
    let Declared {
        problem,
        fitted: accepted,
    } = problem.fit_declared().unwrap();
    let simulated = SimulatedLogs::new(&problem, &accepted).unwrap();
    let drawn = simulated
        .draw(&[], &mut ChaCha8Rng::seed_from_u64(0))
        .unwrap();
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
    for (window, (old, new)) in residuals(&problem)
        .iter()
        .zip(residuals(&again))
        .enumerate()
    {
        let sign = if old.iter().zip(&new).map(|(a, b)| a * b).sum::<f64>() > 0.0 {
            1.0
        } else {
            turned += 1;
            -1.0
        };
        let off = old.iter().zip(&new).map(|(a, b)| (a - sign * b).abs());
        let off = off.fold(0.0, f64::max);
        // Both fits end when a step gains less than 1e-4 of the loss.
        assert!(off < 1e-3, "window {window}: {off}");
    }
    assert!(turned > 5 && turned < after.windows.len() - 5, "{turned}");
}

#[test]
fn complete_models_raise_no_false_alarm_and_hidden_effects_are_named() {
    let (declared, library, logs) = (pendulum(), Library::built_in(), logs("", 0));
    let settings = Settings::default();
    let problem = Problem::new(&declared, &library, &logs, &settings);
    let Declared {
        problem,
        fitted: accepted,
    } = problem.fit_declared().unwrap();
    let repeat = |runs: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let calibrator = Calibrator::new(&problem, &accepted, runs, &mut rng).unwrap();
        let search = |simulation| calibrator.search(simulation, &()).unwrap();
        let searched = calibrator.simulations().iter().map(search).collect();
        calibrator.conclude(searched)
    };
    let found = repeat(8);
    // At the nominal 5 %, two alarms in eight have a probability of 6 %, three one of 0.6 %.
    assert!(found.alarms() <= 2, "{:?}", found.named);
    let tried: Vec<_> = found
        .limits
        .iter()
        .filter_map(DetectionLimit::verified)
        .collect();
    // The drive's gain cannot be distinguished from the pendulum's constants.
    assert_eq!(tried, [true; 3]);
    let gain = |limit: &&DetectionLimit| limit.effect.effect.name == "actuator_gain";
    let gain = found.limits.iter().find(gain).unwrap();
    assert_eq!(gain.smallest, Smallest::Indistinguishable);
}

#[test]
fn friction_is_named_above_its_detection_limit() {
    const SEEDS: u64 = 4;
    let (declared, library) = (pendulum(), Library::built_in());
    let bare = logs("", 0);
    let settings = Settings::default();
    let problem = Problem::new(&declared, &library, &bare, &settings);
    let Declared {
        problem,
        fitted: accepted,
    } = problem.fit_declared().unwrap();
    let limits = detection_limits(&problem, &accepted).unwrap();
    let friction = |limit: &&DetectionLimit| limit.effect.effect.name == "coulomb_friction";
    let Smallest::Detectable { values, .. } = &limits.iter().find(friction).unwrap().smallest
    else {
        panic!("friction shows in any motion");
    };
    let smallest = values[0];
    let named = |level: f64| {
        let named = |seed: &u64| {
            let logs = logs(&coulomb(level), 100 + seed);
            let problem = Problem::new(&declared, &library, &logs, &settings);
            let rng = &mut ChaCha8Rng::seed_from_u64(*seed);
            let found = find(problem.fit_declared().unwrap(), &[], rng, &()).unwrap();
            let standings = found.chosen.standings.iter();
            let established = standings.filter(|s| s.status == Status::Established);
            let labels = established.map(|s| s.effect.label());
            labels.collect::<Vec<_>>() == ["coulomb_friction on joint 1"]
        };
        (0..SEEDS).filter(named).count()
    };
    assert!(named(0.5 * smallest) <= 1, "half of {smallest}");
    assert!(named(2.0 * smallest) >= 3, "twice {smallest}");
}
