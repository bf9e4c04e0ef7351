//! The bench: its hand-written rigs against the equations of the model files, and a small grid end to end.

use std::collections::BTreeSet;
use std::path::PathBuf;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use residyn::read_model;
use residyn_core::data::{Joint, Log};
use residyn_core::model::{FittedEffect, Library};
use residyn_core::sim::metric::assess;
use residyn_io::write_log;
use residyn_validation::{
    Build, Cell, Flaws, Group, Hidden, Hides, Mechanics, Source, Truth, read, recorded,
};

use crate::support::paths::configs;
use crate::support::tables::rows;
use crate::support::{Scratch, says};

fn path(name: &str) -> PathBuf {
    configs().join("bench").join(name)
}

#[test]
fn the_full_grid_has_cells_of_every_group_and_hides_every_kind_of_effect() {
    let cells = read(&path("effects.toml")).unwrap();
    let of = |group| cells.iter().filter(|cell| cell.group == group).count();
    assert!(of(Group::Single) >= 100, "{}", of(Group::Single));
    assert!(of(Group::Pair) >= 25, "{}", of(Group::Pair));
    assert!(of(Group::None) >= 20, "{}", of(Group::None));
    assert!(of(Group::Outside) >= 20, "{}", of(Group::Outside));
    // The hidden effects of arms are drawn at random.
    let library = Library::built_in();
    let arms = read(&path("arms.toml")).unwrap();
    let settled: Vec<Cell> = arms
        .iter()
        .map(|arm| arm.settled(&library).unwrap())
        .collect();
    let all = cells.iter().chain(&settled);
    let hidden: Vec<&Hidden> = all.flat_map(|cell| &cell.effects).collect();
    let mut missing = library.effects().to_vec();
    missing.retain(|effect| !hidden.iter().any(|hidden| hidden.name == effect.name));
    // The rigs are driven by torques. What a voltage heats is hidden by MuJoCo's motor, in slow/drivetrains.rs.
    missing.retain(|effect| effect.name != "winding_heat");
    let names: Vec<&String> = missing.iter().map(|effect| &effect.name).collect();
    assert!(names.is_empty(), "no cell hides {names:?}");
}

/// Values of the rig's parameters under the model file's names.
fn true_value(mechanics: &Mechanics, name: &str) -> Option<f64> {
    let rig = serde_json::to_value(mechanics).unwrap();
    let declared = mechanics.declared(0.0).get(name).copied();
    declared.or_else(|| rig.get(name)?.as_f64())
}

/// The library's effect with the true numbers, if it is an effect of force, torque, angle or inertia.
fn known(library: &Library, hidden: &Hidden) -> Option<FittedEffect> {
    let effect = library.effect(&hidden.name).ok()?;
    let mut known = FittedEffect::absent(effect, hidden.joint);
    for (slot, parameter) in known.values.iter_mut().zip(&effect.parameters) {
        slot.0 = *hidden.values.get(&parameter.name)?;
    }
    Some(known)
}

/// Memory and sensors are not part of the equations of motion.
const NOT_IN_THE_EQUATIONS: [&str; 7] = [
    "actuator_delay",
    "actuator_lag",
    "backlash",
    "encoder_eccentricity",
    "joint_compliance",
    "sensor_offset",
    "parameter_shift",
];
/// Angles half a second ahead agree within this \[rad\]: friction that holds a joint in the rig lets it creep here.
const NEAR: f64 = 1e-4;

#[test]
fn rigs_are_drawn_by_their_rules_and_the_same_each_time() {
    let cells = read(&path("real.toml")).unwrap();
    let named = |part: &str| cells.iter().filter(|c| c.id.starts_with(part)).count();
    assert_eq!([named("real/one/"), named("real/two/")], [40, 40]);
    for (number, cell) in cells.iter().enumerate() {
        let Source::Drawn(recipe) = &cell.source else {
            panic!("{}: not drawn", cell.id)
        };
        let draw = || {
            let rng = &mut ChaCha8Rng::seed_from_u64(number as u64);
            recipe.draw(rng).unwrap()
        };
        let drawn = draw();
        assert_eq!(drawn, draw());
        assert_eq!(drawn.effects.len(), recipe.effects + recipe.outside);
        for (k, effect) in drawn.effects.iter().enumerate() {
            let mut others = drawn.effects[..k].iter();
            let allowed = |other: &Hidden| {
                other.joint != effect.joint || recipe.rules.allow(&effect.name, &other.name)
            };
            assert!(others.all(allowed), "{}: {:?}", cell.id, drawn.effects);
        }
        let condition = &drawn.simulation.condition;
        let turn = std::f64::consts::TAU / condition.quantum;
        assert!((4095.0..16385.0).contains(&turn), "{turn}");
        assert!((3..=6).contains(&condition.logs));
        assert!((4.0..=10.0).contains(&condition.seconds));
        assert!((100.0..=500.0).contains(&condition.rate_hz));
        assert!((0.05..=0.2).contains(&condition.flaws.jitter));
        assert!((0.0..=0.03).contains(&condition.flaws.dropped));
        assert_eq!(condition.drive.len(), 2);
    }
}

/// The cell of this name with its rig drawn, and its logs.
fn drawn(grid: &str, id: &str) -> (Cell, Vec<Log>, Truth) {
    let library = Library::built_in();
    let cells = read(&path(grid)).unwrap();
    let cell = cells.into_iter().find(|cell| cell.id == id).unwrap();
    let cell = cell.settled(&library).unwrap();
    let (logs, truth) = cell.record(&cell.declared(&library).unwrap()).unwrap();
    (cell, logs, truth)
}

/// The kind and the build of a robot's cell.
fn of_robot(cell: &Cell) -> (Hides, &Build) {
    match &cell.source {
        Source::Robot(robot) => (robot.hides, &robot.build),
        _ => panic!("{}: not a robot", cell.id),
    }
}

/// The number of an effect on a joint, if it is hidden there.
fn number(cell: &Cell, name: &str, joint: Joint) -> Option<f64> {
    let mut own = cell.effects.iter();
    let own = own.find(|effect| effect.name == name && effect.joint == joint)?;
    own.values.values().next().copied()
}

/// What only one kind of robot hides.
const OF_ONE_KIND: [(Hides, &str); 3] = [
    (Hides::Gains, "actuator_gain"),
    (Hides::Limits, "actuator_saturation"),
    (Hides::Zeros, "sensor_offset"),
];

#[test]
fn robots_hide_what_their_kind_says_on_joints_that_can_have_it() {
    let library = Library::built_in();
    let cells = read(&path("robots.toml")).unwrap();
    let first = cells.iter().filter(|cell| cell.id.ends_with("/1"));
    for cell in first.map(|cell| cell.settled(&library).unwrap()) {
        let (hides, build) = of_robot(&cell);
        let joints: Vec<Joint> = Joint::all(build.targets.len()).collect();
        assert_eq!(cell.effects.is_empty(), hides == Hides::Nothing);
        let labels: BTreeSet<String> = cell.effects.iter().map(Hidden::label).collect();
        assert_eq!(labels.len(), cell.effects.len(), "{}", cell.id);
        for (kind, name) in OF_ONE_KIND {
            let found = cell.effects.iter().any(|effect| effect.name == name);
            assert_eq!(found, kind == hides, "{}: {name}", cell.id);
        }
        let delays = joints
            .iter()
            .map(|joint| number(&cell, "actuator_delay", *joint));
        let delays: Vec<Option<f64>> = delays.collect();
        assert!(delays.windows(2).all(|two| two[0] == two[1]), "{delays:?}");
        let spread = |name: &str, set: &[Joint]| {
            let found = set.iter().filter_map(|joint| number(&cell, name, *joint));
            let found: Vec<f64> = found.collect();
            assert!(found.is_empty() || found.len() == set.len(), "{}", cell.id);
            let most = found.iter().copied().fold(f64::MIN, f64::max);
            (!found.is_empty()).then(|| most / found.iter().copied().fold(f64::MAX, f64::min))
        };
        let spreads = |name| build.like.iter().filter_map(move |set| spread(name, set));
        let worn = spreads("coulomb_friction").filter(|spread| *spread > 1.7);
        assert_eq!(
            worn.count(),
            usize::from(hides == Hides::Worn),
            "{}",
            cell.id
        );
        for name in ["viscous_friction", "rotor_inertia"] {
            assert!(spreads(name).all(|spread| spread < 1.07), "{}", cell.id);
        }
    }
}

#[test]
fn sticking_joints_rest_about_half_of_the_time() {
    let mut shares = Vec::new();
    for number in 1..=8 {
        let (_, logs, truth) = drawn("sticking.toml", &format!("sticking/hidden/{number}"));
        assert_eq!(truth.effects.len(), 2);
        let q = &logs[0].q[0];
        // Noise and the encoder's step stay below a milliradian.
        let rests = q.windows(4).filter(|four| (four[3] - four[0]).abs() < 2e-3);
        shares.push(rests.count() as f64 / q.len() as f64);
    }
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    assert!((0.35..0.75).contains(&mean), "{shares:?}");
}

#[test]
fn what_the_model_declares_is_not_hidden() {
    let (cell, _, truth) = drawn("sticking.toml", "sticking/declared/1");
    assert_eq!((cell.effects.len(), truth.effects.len()), (2, 0));
}

#[test]
fn logs_with_repeated_rows_are_otherwise_those_without() {
    let (mut cell, logs, _) = drawn("repeated.toml", "repeated/none/1");
    let Source::Simulated(simulation) = &mut cell.source else {
        panic!("{}: not simulated", cell.id)
    };
    simulation.condition.flaws.repeated = 0.0;
    let model = cell.declared(&Library::built_in()).unwrap();
    let (clean, _) = cell.record(&model).unwrap();
    let [mut changed, mut all] = [0, 0];
    for (log, clean) in logs.iter().zip(&clean) {
        assert_eq!(log.time, clean.time);
        for row in 1..log.rows() {
            let q = log.q[0][row];
            assert!(q == clean.q[0][row] || q == log.q[0][row - 1]);
            changed += usize::from(log.tau[0][row] != clean.tau[0][row]);
        }
        all += log.rows();
    }
    let share = changed as f64 / all as f64;
    assert!((0.005..0.15).contains(&share), "{share}");
}

#[test]
fn logs_recorded_by_another_program_are_cells() {
    let scratch = Scratch::new();
    std::fs::create_dir(scratch.path("rig-01")).unwrap();
    let cell = &read(&path("smoke.toml")).unwrap()[0];
    let system = read_model(&cell.model, &Library::built_in()).unwrap();
    let (logs, truth) = cell.record(&system).unwrap();
    for log in &logs {
        write_log(log, scratch.path("rig-01").join(&log.path)).unwrap();
    }
    let described = serde_json::json!({
        "group": "single", "plant": "rig", "recorded_by": "another", "model": "pendulum",
        "effects": [{"name": "coulomb_friction", "joint": 1, "F_c": 0.2}],
        "logs": ["log1.csv", "log2.csv", "log3.csv"],
        "declared": truth.declared,
    });
    scratch.file("rig-01/cell.json", described.to_string());
    let cells = recorded(scratch.folder(), &path("smoke.toml")).unwrap();
    assert_eq!(cells[0].id, "rig/coulomb_friction@1(F_c=0.2)/another/1");
    let (again, same_truth) = cells[0].record(&system).unwrap();
    assert_eq!((again[2].q.clone(), same_truth), (logs[2].q.clone(), truth));
}

/// Flags of `residyn bench effects`, and words of the message.
const REFUSED: &str = "
--grid $REPO/configs/bench/smoke.toml --only nothing-of-the-kind | no cell's name contains
--grid no-such-grid.toml                                         | give a grid with --grid
--logs recorded                                                  | cell.json: missing field `group`
";

#[test]
fn a_wrong_grid_or_selection_is_refused() {
    let scratch = Scratch::new();
    std::fs::create_dir_all(scratch.path("recorded/rig-01")).unwrap();
    scratch.file("recorded/rig-01/cell.json", "{}");
    for [flags, words] in rows(REFUSED) {
        let message = scratch.refuses(&format!("bench effects {flags}"));
        says(&message, &[&words]);
    }
}

mod slow {
    use super::*;

    #[test]
    fn bench_rigs_and_effect_files_agree_on_every_effect() {
        let library = Library::built_in();
        let mut compared = 0;
        for mut cell in read(&path("effects.toml")).unwrap() {
            let in_equations =
                |hidden: &Hidden| !NOT_IN_THE_EQUATIONS.contains(&hidden.name.as_str());
            let plain = cell.condition == "base" && cell.group == Group::Single;
            if !(plain && cell.effects.iter().all(in_equations)) {
                continue;
            }
            let Source::Simulated(simulation) = &mut cell.source else {
                panic!("the grid's rigs are simulated")
            };
            let mechanics = simulation.mechanics.clone();
            let condition = &mut simulation.condition;
            condition.noise = 0.0;
            condition.rate_hz = 500.0;
            condition.logs = 2;
            condition.seconds = 6.0;
            let system = read_model(&cell.model, &library).unwrap();
            let (logs, _) = cell.record(&system).unwrap();
            let error = |effects: &[FittedEffect]| {
                let rig = system.with_effects(effects.to_vec());
                let mut rig = rig.with_smoothing_velocities(vec![1e-4; system.joints]);
                for parameter in &mut rig.parameters {
                    parameter.value =
                        true_value(&mechanics, &parameter.name).expect("the rig has it");
                }
                assess(&rig.dynamics(), &logs, &[0.5]).position_rms()
            };
            let effects: Option<Vec<FittedEffect>> = cell
                .effects
                .iter()
                .map(|hidden| known(&library, hidden))
                .collect();
            let (with, without) = (error(&effects.expect("the library knows it")), error(&[]));
            assert!(
                with < NEAR && with < 0.02 * without,
                "{}: {with} rad with it, {without} without",
                cell.id
            );
            compared += 1;
        }
        assert!(compared > 50, "{compared}");
    }

    #[test]
    fn a_drawn_rig_starts_off_and_is_the_same_each_time() {
        let library = Library::built_in();
        let cells = read(&path("real.toml")).unwrap();
        for (id, effects) in [("real/none/1", 0), ("real/one/1", 2)] {
            let cell = cells.iter().find(|cell| cell.id == id).unwrap();
            let settled = cell.settled(&library).unwrap();
            assert_eq!(settled, cell.settled(&library).unwrap());
            assert_eq!((settled.id.as_str(), settled.effects.len()), (id, effects));
            let model = settled.declared(&library).unwrap();
            let (logs, truth) = settled.record(&model).unwrap();
            assert_eq!(logs, settled.record(&model).unwrap().0);
            for parameter in &model.parameters {
                let off = parameter.value / truth.declared[&parameter.name];
                assert!((0.2..=5.0).contains(&off), "{}: {off}", parameter.name);
                assert_ne!(off, 1.0);
            }
        }
    }

    #[test]
    fn a_robot_moves_as_its_model_with_what_it_hides() {
        let library = Library::built_in();
        let cells = read(&path("robots.toml")).unwrap();
        for id in [
            "robot/leg/limits/1",
            "robot/arm/gains/1",
            "robot/quadruped/worn/1",
            "robot/torso/zeros/1",
        ] {
            let mut cell = cells.iter().find(|cell| cell.id == id).unwrap().clone();
            let Source::Robot(robot) = &mut cell.source else {
                panic!("{id}: not a robot")
            };
            let build = &mut robot.build;
            (build.bodies, build.noise, build.quantum) = ([0.0; 2], 0.0, 0.0);
            // In rows 10 ms apart the states at which windows start say less than the comparison needs.
            (build.logs, build.seconds, build.rate_hz) = (2, 3.0, 1000.0);
            robot.flaws = Flaws::default();
            let cell = cell.settled(&library).unwrap();
            assert_eq!(cell, cell.settled(&library).unwrap(), "{id}: drawn anew");
            let model = cell.declared(&library).unwrap();
            let (logs, _) = cell.record(&model).unwrap();
            assert_eq!(logs, cell.record(&model).unwrap().0, "{id}: recorded anew");
            let error = |effects: &[FittedEffect]| {
                let rig = model.with_effects(effects.to_vec());
                let rig = rig.with_smoothing_velocities(vec![1e-3; model.joints]);
                assess(&rig.dynamics(), &logs, &[0.5]).position_rms()
            };
            let effects = cell.effects.iter().map(|hidden| known(&library, hidden));
            let effects: Option<Vec<FittedEffect>> = effects.collect();
            let (with, without) = (error(&effects.unwrap()), error(&[]));
            assert!(
                with < 1e-3 && with < 0.02 * without,
                "{id}: {with} rad with it, {without} without"
            );
        }
    }

    #[test]
    fn a_small_grid_gives_a_table_and_a_broken_run_goes_on() {
        let scratch = Scratch::new();
        let run = |only: &str| {
            let grid = "--grid $REPO/configs/bench/smoke.toml";
            scratch.json(&format!("bench effects {grid} --out out --only {only}"))
        };
        let lines = || {
            let text = scratch.read("out/cells.jsonl");
            let whole = text.lines().filter(|line| !line.is_empty());
            whole.map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(run("none")["cells"], 1);
        // An incomplete line is not a result, and is cut off.
        let first = lines();
        scratch.file("out/cells.jsonl", format!("{}\n{{\"conf", first[0]));
        let summary = run("none coulomb");
        assert_eq!((summary["cells"].as_u64(), lines().len()), (Some(2), 2));
        assert_eq!(lines()[0], first[0], "the first cell is not run again");
        let coulomb: serde_json::Value = serde_json::from_str(&lines()[1]).unwrap();
        let errors = &coulomb["findings"]["Ok"]["errors"];
        let error = |which: &str| errors[which].as_f64().unwrap();
        // A model that includes the friction predicts far better than one that does not.
        assert!(error("message") < 0.2 * error("before"), "{errors}");
        says(&scratch.read("out/table.md"), &["| one effect: exact |"]);
        crate::support::clients::look_at(&scratch.path("out/report.html"));
    }
}
