//! A residual that no effect of the library explains is distinguished from noise, and located.

use std::path::Path;

use residyn::with_effects_in;
use residyn_core::closeloop::{
    Declared, Problem, Proposal, Settings, Unexplained, proposal, unexplained,
};
use residyn_core::data::{Joint, Log};
use residyn_core::model::{FittedEffect, Library, Model};
use residyn_io::plant_from_text;

use crate::support::catalogue::rng;

/// A pendulum that hangs at q1 = 0, driven by a geared motor; its encoder and its hidden effects are added.
const RIG: &str = r#"
model = "pendulum"
parameters = { C_g = -17.4, C_i = 4.6 }
excitation = { amplitude = [1.6], band_hz = [0.15, 2.0], tones = 8 }
recording = { logs = 5, duration_s = 10, start = [0, 0] }
"#;

/// White noise of a milliradian, and an encoder of 4096 steps a turn.
const WHITE: &str = "position_noise = 1e-3, position_step = 0.0";
const QUANTISED: &str = "position_noise = 2e-4, position_step = 1.5339807878856412e-3";

/// An effect file that is in no library.
fn effect(name: &str, force: &str) -> String {
    format!(
        "[effect]\nname = \"{name}\"\nabout = \"hidden\"\nforce = \"{force}\"\n[parameters]\n\
         size = {{ unit = \"1\", typical = 1.0 }}\n"
    )
}

/// The library with a folder of these files.
fn library(files: &[String]) -> Library {
    let folder = tempfile::tempdir().unwrap();
    for (number, file) in files.iter().enumerate() {
        std::fs::write(folder.path().join(format!("{number}.toml")), file).unwrap();
    }
    with_effects_in(folder.path(), Library::built_in()).unwrap()
}

/// Logs of the rig with the hidden force.
fn logs(sensor: &str, force: &str, seed: u64) -> Vec<Log> {
    let library = library(&[effect("hidden", force)]);
    let text = format!("{RIG}sensor = {{ rate_hz = 100, {sensor} }}\n");
    let mut plant = plant_from_text(Path::new("rig.toml"), &text, &library).unwrap();
    plant
        .add_effect(&library, "hidden", Joint::at(0), &[])
        .unwrap();
    let mut rng = rng(seed);
    (0..plant.recording.logs)
        .map(|_| plant.record(&mut rng).unwrap())
        .collect()
}

/// The pendulum with these effects declared, their sizes unknown.
fn declared(effects: &[&str]) -> Model {
    let library = Library::built_in();
    let mut system = library.model("pendulum").unwrap();
    system.parameters[0].value = -17.0;
    system.parameters[1].value = 4.0;
    let absent = |name: &&str| FittedEffect::absent(library.effect(name).unwrap(), Joint::at(0));
    system.effects = effects.iter().map(absent).collect();
    system
}

/// The pendulum's unexplained residual on the logs with these effects, compared with the pendulum without them.
fn left(logs: &[Log], effects: &[&str], seed: u64) -> Unexplained {
    let (bare, system) = (declared(&[]), declared(effects));
    let (settings, nothing, probes) = (Settings::default(), Library::empty(), Library::built_in());
    let fitted = |model| {
        let problem = Problem::new(model, &nothing, logs, &settings);
        problem.fit_declared().unwrap()
    };
    let (before, Declared { problem, fitted }) = (fitted(&bare).fitted, fitted(&system));
    unexplained(&problem, probes.probes(), &before, &fitted, &mut rng(seed))
}

/// A formula for the bare pendulum's residual on the logs.
fn proposed(logs: &[Log], seed: u64) -> Option<Proposal> {
    let system = declared(&[]);
    let (settings, nothing, probes) = (Settings::default(), Library::empty(), Library::built_in());
    let problem = Problem::new(&system, &nothing, logs, &settings);
    let Declared { problem, fitted } = problem.fit_declared().unwrap();
    let left = unexplained(&problem, probes.probes(), &fitted, &fitted, &mut rng(seed));
    proposal(&problem, &fitted, &left)
}

/// A declared effect of the library leaves no significant residual, although the rig's friction is sharper.
#[test]
fn a_found_effect_leaves_no_remainder() {
    for seed in 0..3 {
        let logs = logs(QUANTISED, "-0.16*size*sign(qd)", seed);
        let left = left(&logs, &["coulomb_friction"], seed);
        assert!(!left.is_significant(), "{seed}: {left:?}");
    }
}

#[test]
fn cubic_damping_is_proposed_with_its_size() {
    for seed in 0..3 {
        let found = proposed(&logs(WHITE, "-0.0015*size*qd^3", seed), seed).unwrap();
        assert!(found.formula.ends_with(" * qd1^3"), "{found:?}");
        let size: f64 = found.formula.split(' ').next().unwrap().parse().unwrap();
        assert!((size + 0.0015).abs() < 1e-4, "{found:?}");
        assert!(found.explains > 0.8, "{found:?}");
        // The report prints a file that `--effects` accepts.
        let library = library(&[found.file]);
        assert_eq!(
            library.effect("proposed").unwrap().parameters[0].unit,
            "N m s^3/rad^3"
        );
    }
}

#[test]
fn nothing_is_proposed_for_noise() {
    assert_eq!(proposed(&logs(WHITE, "0*size", 3), 3), None);
}

/// A spring between motor and link, with logs of the motor only.
const COMPLIANT: &str = r#"
[system]
name = "compliant"
joints = 2
[parameters]
k = { value = 30.0, unit = "N m/rad" }
[dynamics]
qdd1 = "20*(tau1 - k*(q1 - q2) - 0.02*(qd1 - qd2))"
qdd2 = "6*(k*(q1 - q2) + 0.02*(qd1 - qd2)) - 17.4*sin(q2)"
"#;

/// A force of `k` times a state that moves at `rate`, modelled as the velocity of a second joint.
fn remembering(k: f64, rate: &str) -> String {
    format!(
        r#"
[system]
name = "remembering"
joints = 2
[parameters]
k = {{ value = {k:?} }}
[dynamics]
qdd1 = "-17.4*sin(q1) + 4.6*(tau1 - k*qd2)"
qdd2 = "{rate}"
"#
    )
}

/// A bristle that bends before the joint slides (Dahl 1968): 4 N m/rad times its deflection.
fn presliding() -> String {
    remembering(4.0, "qd1 - 20*abs(qd1)*qd2")
}

/// A damper in series with a spring: it feels what the speed was, 0.4 N m s/rad of it.
fn yielding() -> String {
    remembering(0.4, "(qd1 - qd2) / 0.3")
}

/// Logs of the first of two joints.
fn logs_of_first(model: &str, seed: u64) -> Vec<Log> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("rig.toml"), model).unwrap();
    let text = RIG
        .replace("pendulum", "rig.toml")
        .replace("{ C_g = -17.4, C_i = 4.6 }", "{}");
    let text = text
        .replace("[1.6]", "[1.6, 0.0]")
        .replace("[0, 0]", "[0, 0, 0, 0]");
    let text = format!("{text}sensor = {{ rate_hz = 100, {WHITE} }}\n");
    let plant = plant_from_text(
        &folder.path().join("plant.toml"),
        &text,
        &Library::built_in(),
    );
    let (plant, mut rng) = (plant.unwrap(), rng(seed));
    (0..plant.recording.logs)
        .map(|_| {
            let mut log = plant.record(&mut rng).unwrap();
            for columns in [&mut log.q, &mut log.qd, &mut log.tau] {
                columns.truncate(1);
            }
            log
        })
        .collect()
}

/// An effect with internal state is not a function of angle, speed, torque and time; it is detected all the same, in
/// addition to the effects that come nearest.
#[test]
fn effects_with_internal_state_are_not_taken_for_noise() {
    for model in [COMPLIANT.to_owned(), presliding()] {
        let logs = logs_of_first(&model, 1);
        for effects in [&[][..], &["viscous_friction", "coulomb_friction"]] {
            let left = left(&logs, effects, 1);
            assert!(
                left.is_significant() && left.p_value < 0.01,
                "{model}, {effects:?}: {left:?}"
            );
        }
    }
}

#[test]
fn a_force_with_a_memory_is_proposed_with_the_rate_of_its_state() {
    for (model, rate, size, scale) in [
        (yielding(), "dw1/dt = (qd1 - w1) / ", 0.4, 0.3),
        (presliding(), "dw1/dt = (qd1 - abs(qd1) * w1) / ", 0.2, 0.05),
    ] {
        let found = proposed(&logs_of_first(&model, 1), 1).unwrap();
        assert!(found.formula.contains(rate), "{found:?}");
        assert!(found.explains > 0.8, "{found:?}");
        let library = library(std::slice::from_ref(&found.file));
        let parameters = &library.effect("proposed").unwrap().parameters;
        let typical = [&parameters[0], parameters.last().unwrap()].map(|own| own.typical);
        let is_near = |(own, truth): (f64, f64)| (own / truth - 1.0).abs() < 0.1;
        let both = typical.into_iter().zip([size, scale]);
        assert!(both.into_iter().all(is_near), "{found:?}");
    }
}

mod slow {
    use super::*;

    #[test]
    fn noise_is_not_significant() {
        for sensor in [WHITE, QUANTISED] {
            for seed in 0..8 {
                let left = left(&logs(sensor, "0*size", seed), &[], seed);
                assert!(
                    !left.is_significant() && left.p_value > 0.01,
                    "{sensor}, {seed}: {left:?}"
                );
            }
        }
    }

    /// Forces that no effect of the library describes, and on which variable they depend.
    #[test]
    fn what_the_library_lacks_is_located() {
        let cases = [
            ("-0.0015*size*qd^3", "qd1"),
            ("-0.15*size*sign(qd)*(1 + sin(q))", "q1*qd1"),
            ("-0.02*size*t*sign(qd)", "t"),
            ("clamp(tau, -1.2*size - 0.1*qd, 1.2 - 0.1*qd) - tau", "tau1"),
            ("0.1*size*sin(25*t)", "unknown"),
        ];
        for (force, place) in cases {
            for sensor in [WHITE, QUANTISED] {
                let left = left(&logs(sensor, force, 1), &[], 1);
                assert_eq!(left.place, place, "{force}, {sensor}: {left:?}");
                assert!(left.p_value < 0.01);
            }
        }
    }
}
