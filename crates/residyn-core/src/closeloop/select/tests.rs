//! Tests on a simulated pendulum with dry friction: sets are compared before they are fitted.

use super::baseline::{baseline_friction, baseline_sets};
use super::candidate::candidates;
use super::exchange::{Exchange, Hopeless, exchanges};
use super::folds::{Folds, left_out_losses, predicted};
use super::screening::Screening;
use super::simpler::{parts, repaired, simpler};
use super::trial::Trial;
use crate::closeloop::fit::Declared;
use crate::closeloop::tests::{FAST_PENDULUM, Study, absent, pendulum};
use crate::model::{FittedEffect, Library, Side};

#[test]
fn what_is_left_out_together_is_a_connected_part_of_one_log() {
    let study = Study::of_friction();
    let problem = study.closed();
    let folds = Folds::of(&problem);
    assert!(folds.groups.is_sorted(), "{:?}", folds.groups);
    let mut logs_of = std::collections::HashMap::new();
    for (window, &block) in problem.shooting.windows.iter().zip(&folds.blocks) {
        let log = logs_of.entry(folds.groups[block]).or_insert(window.log);
        assert_eq!(*log, window.log);
    }
    assert!(logs_of.len() >= study.settings.select.fewest_groups);
}

#[test]
fn halves_of_many_logs_are_whole_logs() {
    let study = Study::of_friction();
    let logs = [study.logs.as_slice(), &study.logs].concat();
    let problem = study.problem().on(&logs);
    let halves = Folds::of(&problem).in_halves();
    for (block, window) in halves.blocks.iter().zip(&problem.shooting.windows) {
        assert_eq!(halves.groups[*block], window.log % 2);
    }
    let few = problem.on(&study.logs);
    let halves = Folds::of(&few).in_halves();
    assert_eq!(halves.groups[..4], [0, 1, 0, 1]);
}

#[test]
fn a_loss_far_below_zero_is_rounding_and_no_loss() {
    assert_eq!(predicted(3.0, -2.0, 2.0), 2.0);
    assert_eq!(predicted(1.0, -2.0, 2.0), 0.0);
    let lost = predicted(3.0, -1e4, 0.0);
    assert_eq!(lost, f64::INFINITY);
}

#[test]
fn the_outlook_knows_the_loss_of_the_model_and_promises_the_hidden_effect() {
    let study = Study::of_friction();
    let Declared { problem, fitted } = study.fitted();
    let all = candidates(&problem, &[]);
    let screening = Screening::of(&problem, &fitted, &all).unwrap();
    let loss = |set: &[usize]| screening.loss(set).unwrap();
    let known: f64 = left_out_losses(&Folds::of(&problem), &fitted.fit)
        .iter()
        .sum();
    assert!((loss(&[]) / known - 1.0).abs() < 0.01);

    let mut items = screening.items.iter().map(FittedEffect::label);
    let coulomb = items.position(|label| label.starts_with("coulomb"));
    let coulomb = coulomb.unwrap();
    let effects = screening.effects(&[coulomb]);
    let with = problem.with_effects(&fitted, effects).unwrap();
    let found: f64 = left_out_losses(&Folds::of(&problem), &with.fit)
        .iter()
        .sum();
    assert!(found < 0.2 * known);
    let promised = loss(&[coulomb]);
    assert!(promised < 0.3 * known, "{promised} {found} {known}");
}

/// An encoder disc whose eccentricity is at its bound was not found there.
#[test]
fn a_set_with_a_value_at_its_bound_is_not_valid() {
    let study = Study::of_friction();
    let Declared { problem, fitted } = study.fitted();
    let effects = vec![absent("coulomb_friction"), absent("encoder_eccentricity")];
    let fitted = problem.with_effects(&fitted, effects).unwrap();
    let mut trial = Trial::of(&problem, fitted);
    assert!(trial.is_valid(&problem));
    let disc = &mut trial.fitted.model.effects[1];
    disc.values[0].0 = disc.effect.parameters[0].bounds[1];
    assert!(!trial.is_valid(&problem));
}

/// A user's library says what most machines have, whatever its effects are called.
#[test]
fn what_most_machines_have_is_said_by_effect_files() {
    let drag = |name: &str, rank: &str| {
        let effect = format!(
            "[effect]\nname = \"{name}\"\nabout = \"drag\"\nforce = \"-c * qd\"\n{rank}\n\
             [parameters]\nc = {{ unit = \"N m s/rad\", typical = 1 }}\n"
        );
        effect.parse().unwrap()
    };
    let library = Library::empty()
        .with_effect(drag("bearing", "baseline = 3"))
        .with_effect(drag("grease", "baseline = 1"))
        .with_effect(drag("magnet", ""));
    let study = Study {
        library,
        ..Study::of_friction()
    };
    let problem = study.problem();
    let name = |effect: &FittedEffect| effect.effect.name.clone();
    let names = |set: &Vec<FittedEffect>| -> Vec<String> { set.iter().map(name).collect() };
    let sets: Vec<_> = baseline_sets(&problem).iter().map(names).collect();
    assert_eq!(sets, [vec!["grease"], vec!["bearing", "grease"]]);
    assert_eq!(names(&baseline_friction(&problem)), ["grease"]);
}

#[test]
fn both_sides_of_a_transmission_are_tried_unless_the_file_says_where_the_sensor_is() {
    let mut study = Study::of_friction();
    let sides = |study: &Study| {
        let FittedEffect { effect, joint, .. } = absent("joint_elasticity");
        let measured = study.problem().measured(&effect, joint);
        let mut parameters = measured.parameters.into_iter();
        parameters.find(|own| own.name == "sensor").unwrap().starts
    };
    assert_eq!(sides(&study), [1.0, 0.0]);
    study.declared.sides = Some(vec![Side::Link]);
    assert_eq!(sides(&study), [0.0]);
}

/// At the largest possible Stribeck velocity, friction does not fall: it is Coulomb friction at the level found.
#[test]
fn an_effect_at_a_bound_gives_way_to_what_it_contains() {
    let study = Study::of_friction();
    let mut stribeck = absent("stribeck_friction");
    let fastest = stribeck.effect.parameters[2].bounds[1];
    stribeck.values = vec![(0.1, None), (0.2, None), (fastest, None)];
    let set = [absent("joint_spring"), stribeck];
    let mended = repaired(&study.problem(), &[], &set);
    let labels: Vec<String> = mended.iter().map(FittedEffect::label).collect();
    let wanted = ["joint_spring on joint 1", "coulomb_friction on joint 1"];
    assert_eq!(labels, wanted);
    assert_eq!(mended[1].values[0].0, 0.1);
}

#[test]
fn a_part_begins_with_the_values_of_the_whole_and_in_the_units_of_its_joint() {
    let study = Study::of_friction();
    let mut problem = study.problem();
    problem.top_torque = vec![40.0];
    for (whole, values, name, value) in [
        (
            "stribeck_friction",
            vec![0.3, 0.5, 0.1],
            "coulomb_friction",
            0.3,
        ),
        (
            "torque_speed_limit",
            vec![25.0, 8.0],
            "actuator_saturation",
            25.0,
        ),
    ] {
        let mut whole = absent(whole);
        for (slot, value) in whole.values.iter_mut().zip(values) {
            slot.0 = value;
        }
        let parts = parts(&problem, &whole);
        let part = parts
            .iter()
            .find(|known| known.effect.name == name)
            .unwrap();
        let [low, high] = part.effect.parameters[0].bounds;
        assert_eq!(part.values[0].0, value);
        assert!(low < value && value < high, "{name}: {low} to {high}");
    }
}

/// With a free inertia, a torque gain can have any value.
#[test]
fn a_set_whose_values_the_logs_do_not_tell_apart_is_not_valid() {
    let study = Study::of_friction();
    let Declared { problem, fitted } = study.fitted();
    let is_valid = |names: &[&str]| {
        let effects = names.iter().map(|name| absent(name)).collect();
        let fitted = problem.with_effects(&fitted, effects).unwrap();
        Trial::of(&problem, fitted).is_valid(&problem)
    };
    assert!(is_valid(&["coulomb_friction"]));
    assert!(!is_valid(&["coulomb_friction", "actuator_gain"]));
}

#[test]
fn simpler_sets_have_fewer_parameters() {
    let study = Study::of_friction();
    let sets = simpler(&study.problem(), &[absent("asymmetric_friction")], 0..1);
    let mut most: Vec<&str> = (sets.last().unwrap().iter())
        .map(|effect| &*effect.effect.name)
        .collect();
    most.sort_unstable();
    let parts = ["constant_torque", "coulomb_friction", "viscous_friction"];
    assert_eq!(most, parts);
}

/// Friction that a file declares is not added again: no file may hold it twice.
#[test]
fn simpler_sets_hold_no_effect_twice() {
    let study = Study::of_friction();
    let effects = ["viscous_friction", "asymmetric_friction"].map(absent);
    let sets = simpler(&study.problem(), &effects, 1..2);
    let is_twice = |set: &Vec<FittedEffect>| {
        let again = |effect: &FittedEffect| effect.is_same(&effects[0]);
        set.iter().filter(|effect| again(effect)).count() > 1
    };
    assert!(!sets.is_empty() && !sets.iter().any(is_twice));
    let [declared, whole] = effects;
    let mut broken = whole;
    broken.values[0].0 = f64::NAN;
    let mended = repaired(&study.problem(), &[declared], &[broken]);
    let names: Vec<&str> = mended.iter().map(|effect| &*effect.effect.name).collect();
    assert!(!names.contains(&"viscous_friction"), "{names:?}");
}

/// The lag takes over the value of the delay, and the ripple is tried with the number of periods of the rig and with
/// the numbers next to its present one.
#[test]
fn exchanges_start_near_what_they_replace() {
    const HIDDEN: &str = r#"
effect = [
    { name = "actuator_lag", joint = 1, T = 0.03 },
    { name = "cogging_torque", joint = 1, A = 0.3, N = 7, phase = 0.4 },
]
"#;
    let study = Study::of(pendulum(), &[FAST_PENDULUM, HIDDEN].concat());
    let Declared { problem, fitted } = study.fitted();
    let mut ripple = absent("cogging_torque");
    ripple.values = vec![(0.1, None), (6.0, None), (0.4, None)];
    let set = vec![absent("actuator_delay"), ripple];
    let wrong = problem.with_effects(&fitted, set).unwrap();
    let delay = wrong.model.effects[0].values[0].0;
    assert!(delay > 0.01);
    let all = exchanges(&problem, &wrong, f64::INFINITY, &mut Hopeless::default());
    for number in [5.0, 7.0] {
        let mut ripple = wrong.model.effects[1].clone();
        ripple.values[1].0 = number;
        let is_tried = |exchange: &Exchange| exchange.pair[1] == problem.id(&ripple);
        assert!(all.iter().any(is_tried), "{number}");
    }
    let lag = all.iter().flat_map(|exchange| &exchange.set);
    let lag = lag.filter(|effect| effect.effect.name == "actuator_lag");
    assert_eq!(lag.map(|lag| lag.values[0].0).collect::<Vec<_>>(), [delay]);
}
