//! Logs of several configurations of one rig in one fit: gains and loads that tables `[logs."pattern"]` give, and values
//! that a fit finds for each log or group.

use std::path::Path;

use residyn_core::data::{Joint, Log};
use residyn_core::identify::{Shooting, Values, cut, fit, uncertainty};
use residyn_core::model::{Dynamics, FittedEffect, Library, Model};
use residyn_core::sim::Integrator;
use residyn_formats::{ExportModel, find};
use residyn_io::{plant_from_text, read_log, read_model, with_values_of};
use serde_json::Value;

use crate::support::catalogue::{effect, rng};
use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, says};

/// A servo that carries a load of `m` at 0.25 m, with what a test says of its logs.
fn servo(text: &str, load: &str, tables: &str) -> String {
    format!(
        r#"
[system]
name = "servo"
joints = 1
[parameters]
{text}
kp = {{ value = 15, unit = "N m/rad", fixed = true }}
kd = {{ value = 0.4, unit = "N m s/rad", fixed = true }}
m = {{ value = 0, unit = "kg"{load} }}
[drive]
tau1 = "kp*(cmd1 - q1) - kd*qd1"
[dynamics]
mass = [["J + 0.0625*m"]]
bias = ["(G + 0.25*9.81*m)*sin(q1)"]
{tables}"#
    )
}

const FREE: &str = "J = { value = 0.02, positive = true }\nG = { value = 0.6, positive = true }";
const KNOWN: &str = "J = { value = 0.023, fixed = true }\nG = { value = 0.7, fixed = true }";

fn read(text: &str) -> Model {
    let library = Library::built_in();
    let model = library.model_from_text("servo.toml", text).unwrap();
    model.with_smoothing_velocities(vec![0.01])
}

/// A log of the rig: its name, its stiffness in N m/rad, its load in kg and what its drive hides.
fn recorded(name: &str, kp: f64, load: f64, hidden: &[FittedEffect]) -> Log {
    let (j, g) = (0.023 + 0.0625 * load, 0.7 + 0.25 * 9.81 * load);
    let text = format!(
        "model = \"servo\"\nparameters = {{ J = {j:?}, G = {g:?}, kp = {kp:?}, limit = 50.0 }}\n\
         sensor = {{ rate_hz = 100, position_noise = 5e-4, position_step = 0 }}\n\
         excitation = {{ amplitude = [1.2], band_hz = [0.1, 3.0], tones = 8 }}\n\
         recording = {{ logs = 1, duration_s = 12, start = [0, 0] }}\n"
    );
    let library = Library::built_in();
    let mut plant = plant_from_text(Path::new("rig.toml"), &text, &library).unwrap();
    for effect in hidden {
        let names = effect.effect.parameters.iter().map(|p| p.name.clone());
        let values: Vec<_> = names.zip(effect.values.iter().map(|v| v.0)).collect();
        plant
            .add_effect(&library, &effect.effect.name, Joint::at(0), &values)
            .unwrap();
    }
    let seed = name.bytes().map(u64::from).sum();
    let mut log = plant.record(&mut rng(seed)).unwrap();
    log.path = name.into();
    log
}

/// The model fitted to logs, and the half width of the interval of each free value, by its parameter's name.
fn fitted(model: &Model, logs: &[Log]) -> (Model, Vec<(String, f64)>) {
    let dynamics: Dynamics = model.dynamics();
    let all = 0..dynamics.parameters.len();
    let active: Vec<usize> = all.filter(|k| !dynamics.parameters[*k].fixed).collect();
    let shooting = Shooting::new(logs, cut(logs, 0.5), &[5e-4]);
    let states = shooting.initial_start_states(0);
    let (values, found): (Values, _) = fit(&shooting, &dynamics, &active, states, None).unwrap();
    let uncertainty = uncertainty(&shooting, &found);
    let half = |(i, column): (usize, &residyn_core::identify::Column)| {
        let name = dynamics.parameters[column.parameter].name.clone();
        (name, uncertainty.half_width(i))
    };
    let half_widths = found.columns.iter().enumerate().map(half).collect();
    (model.at(&values.put_into(&dynamics, logs)), half_widths)
}

fn of_name<T: Copy>(all: &[(String, T)], name: &str) -> T {
    let found = all.iter().find(|(own, _)| own == name);
    found.unwrap_or_else(|| panic!("no {name}")).1
}

/// The value of a parameter in a log.
fn value(model: &Model, name: &str, log: &Log) -> f64 {
    let dynamics = model.dynamics();
    let place = dynamics.parameters.iter().position(|p| p.name == name);
    dynamics.in_log(log).parameters[place.unwrap()].value
}

#[test]
fn a_known_load_and_two_gains_tell_what_the_drive_hides() {
    let hidden = [
        effect("actuator_gain", 0, &[0.25]),
        effect("actuator_delay", 0, &[0.012]),
    ];
    let tables = "[logs.\"*kp30*\"]\nkp = 30\n[logs.\"loaded*.csv\"]\nm = 0.2\n";
    let declared = read(&servo(FREE, ", fixed = true", tables));
    let declared = declared.with_effects(vec![
        effect("actuator_gain", 0, &[0.0]),
        effect("actuator_delay", 0, &[0.002]),
    ]);
    let logs = [
        recorded("kp15.csv", 15.0, 0.0, &hidden),
        recorded("kp30.csv", 30.0, 0.0, &hidden),
        recorded("loaded_kp30.csv", 30.0, 0.2, &hidden),
    ];
    let (found, half) = fitted(&declared, &logs);
    for (name, truth) in [("g1", 0.25), ("d1", 0.012), ("J", 0.023), ("G", 0.7)] {
        let (value, half) = (value(&found, name, &logs[0]), of_name(&half, name));
        assert!(
            (value - truth).abs() < 2.0 * half,
            "{name}: {value} +- {half}"
        );
    }
    assert!(of_name(&half, "g1") < 0.05, "{half:?}");
    // At one gain and without the load all torques could be larger.
    let (_, alone) = fitted(&declared, &logs[..1]);
    assert!(
        of_name(&alone, "g1") > 10.0 * of_name(&half, "g1"),
        "{alone:?}"
    );
    // The gains of the logs stay those of the file, whatever is fitted, and so does the file.
    assert_eq!(value(&found, "kp", &logs[2]), 30.0);
    assert_eq!(value(&found, "m", &logs[1]), 0.0);
    let written = found.file_text();
    says(&written, &["[logs.\"*kp30*\"]", "[logs.\"loaded*.csv\"]"]);
    assert_eq!(value(&read(&written), "kp", &logs[1]), 30.0);
    // The drive's torques are those of the log's own gain.
    let torque = |log: &Log| declared.drive_torques(log)[0][40];
    let mut renamed = logs[1].clone();
    renamed.path = "kp15.csv".into();
    assert!((torque(&logs[1]) - torque(&renamed)).abs() > 1e-3);
}

#[test]
fn a_free_value_does_not_move_where_a_table_gives_one() {
    let tables = "[logs.\"loaded*.csv\"]\nm = 0.2\n";
    let declared = read(&servo(KNOWN, "", tables));
    let logs = [
        recorded("loaded.csv", 15.0, 0.2, &[]),
        recorded("unknown.csv", 15.0, 0.1, &[]),
    ];
    let (found, _) = fitted(&declared, &logs);
    assert_eq!(value(&found, "m", &logs[0]), 0.2);
    assert!((value(&found, "m", &logs[1]) - 0.1).abs() < 2e-3);
    assert!(found.own.is_empty());
}

#[test]
fn a_load_that_is_free_for_each_group_is_found_for_each() {
    let tables = "[logs.\"loaded*.csv\"]\n";
    let logs = [
        recorded("loaded1.csv", 15.0, 0.2, &[]),
        recorded("bare1.csv", 15.0, 0.05, &[]),
        recorded("loaded2.csv", 15.0, 0.2, &[]),
    ];
    let new = ["loaded9.csv", "bare9.csv"].map(|name| Log {
        path: name.into(),
        ..Log::empty(1)
    });
    for (per, columns, of_new) in [("group", 2, [0.2, 0.05]), ("log", 3, [0.15, 0.15])] {
        let declared = read(&servo(KNOWN, &format!(", per = \"{per}\""), tables));
        let (mut found, half) = fitted(&declared, &logs);
        assert_eq!(half.len(), columns, "{per}");
        for (log, truth) in logs.iter().zip([0.2, 0.05, 0.2]) {
            assert!((value(&found, "m", log) - truth).abs() < 2e-3, "{per}");
        }
        // A log that was not fitted has its group's value, or the mean.
        for (log, truth) in new.iter().zip(of_new) {
            assert!((value(&found, "m", log) - truth).abs() < 2e-3, "{per}");
        }
        let m = found.parameters.iter().position(|p| p.name == "m").unwrap();
        found.set_half_width(m, Some(&logs[0]), 1e-3);
        let known = found.own.iter().filter(|own| own.ci95.is_some()).count();
        assert_eq!(known, if per == "group" { 2 } else { 1 });
        let back = read(&found.file_text());
        assert_eq!(back.own, found.own);
        assert_eq!(value(&back, "m", &new[0]), value(&found, "m", &new[0]));
    }
}

#[test]
fn exports_say_which_values_are_those_of_some_logs() {
    let tables = "[logs.\"stiff*\"]\nkp = 30\n";
    let model = read(&servo(KNOWN, ", per = \"log\"", tables));
    let model = ExportModel::of_system(&model, Integrator::RK4, 0.01, Value::Null);
    let not_carried = (find("c").unwrap().not_carried)(&model);
    says(
        &not_carried.join("\n"),
        &[
            "per-log values of m: 0 is written for all logs",
            "values of kp in [logs]: 15 is written for all logs",
        ],
    );
}

/// Tables, what is said of the load, and words of the message.
const WRONG: &str = r#"
[logs."a*"]\nkpp = 3\n        |                 | servo.toml, line ... unknown key `kpp` in [logs.a*] ... did you mean `kp`
[logs."a*"]\nm = -1\n         | , positive = true | `m` is -1, outside its bounds 0 to inf
[logs."a*"]\nm = 1\n          | , per = "group"   | `m` is fitted for each log or group ... remove that or this value
                              | , per = "day"     | `per` must be "log" or "group"
                              | , logs = { "a.csv" = 1 } | give `per = "log"` or `per = "group"` as well
"#;

#[test]
fn a_wrong_table_is_refused_with_its_place() {
    let library = Library::built_in();
    for [tables, load, words] in rows(WRONG) {
        let text = servo(KNOWN, &load, &tables.replace("\\n", "\n"));
        let refused = library.model_from_text("servo.toml", &text).unwrap_err();
        says_words(&refused.to_string(), &words);
    }
}

#[test]
fn a_file_beside_a_log_and_its_recording_give_values_there() {
    let scratch = Scratch::new();
    let tables = "[logs.\"*\"]\nkd = 0.5\nkp = 12\n";
    scratch.file("servo.toml", servo(KNOWN, ", fixed = true", tables));
    scratch.simulates("servo-real", &[1, 2]);
    scratch.file("run1.csv.toml", "kp = 30\n");
    let library = Library::built_in();
    let model = read_model(scratch.path("servo.toml"), &library).unwrap();
    let read = |name: &str| read_log(scratch.path(name), &model).unwrap();
    let (first, mut second) = (read("run1.csv"), read("run2.csv"));
    // Of what a recording says, the model file knows better, and some is none of its parameters.
    second.values = vec![("kd".into(), 7.0), ("m".into(), 0.5), ("site".into(), 3.0)];
    let known = with_values_of(&model, [&first, &second]).unwrap();
    for (name, log, wanted) in [
        ("kp", &first, 30.0),
        ("kd", &first, 0.5),
        ("kp", &second, 12.0),
        ("kd", &second, 0.5),
        ("m", &second, 0.5),
        ("m", &first, 0.0),
    ] {
        assert_eq!(value(&known, name, log), wanted, "{name} in {}", log.name());
    }
    let written = library
        .model_from_text("known.toml", &known.file_text())
        .unwrap();
    assert_eq!(value(&written, "kp", &first), 30.0);
    assert_eq!(value(&written, "m", &second), 0.5);
    let said = scratch
        .run("evaluate --model servo.toml --test run1.csv")
        .stderr;
    says(
        &String::from_utf8(said).unwrap(),
        &["note: run1.csv: in this log kp = 30"],
    );
}

/// What a file beside a log says, and words of the message.
const WRONG_BESIDE: &str = r#"
kq = 3      | run1.csv.toml, line 1, column 1: unknown key `kq` ... did you mean `kp`
kp = "high" | run1.csv.toml, line 1, column 6
m = -1      | `m` is -1, outside its bounds 0 to inf
J =         | run1.csv.toml, line 1
"#;

#[test]
fn a_wrong_file_beside_a_log_is_refused_with_its_place() {
    let scratch = Scratch::new();
    scratch.file("servo.toml", servo(KNOWN, ", positive = true", ""));
    scratch.simulates("servo-real", &[1]);
    for [text, words] in rows(WRONG_BESIDE) {
        scratch.file("run1.csv.toml", text);
        let ran = scratch.run("audit --model servo.toml run1.csv");
        assert_eq!(ran.status.code(), Some(2));
        says_words(&String::from_utf8(ran.stderr).unwrap(), &words);
    }
    let model = read_model(scratch.path("servo.toml"), &Library::built_in()).unwrap();
    let mut log = read_log(scratch.path("run1.csv"), &model).unwrap();
    log.path = "run7.csv".into();
    log.values = vec![("m".into(), -2.0)];
    let refused = with_values_of(&model, [&log]).unwrap_err();
    says(
        &refused.to_string(),
        &["run7.csv: `m` is -2, outside its bounds"],
    );
    log.values = vec![("m".into(), 2.0)];
    let twin = Log {
        path: "other/run7.csv".into(),
        ..log.clone()
    };
    let refused = with_values_of(&model, [&log, &twin]).unwrap_err();
    says(
        &refused.to_string(),
        &["run7.csv: has values of its own and the file name of other/run7.csv"],
    );
}

#[test]
fn a_pattern_that_matches_no_log_is_said() {
    let scratch = Scratch::new();
    let tables = "[logs.\"nothing*\"]\nkp = 30\n[logs.\"run*\"]\nkp = 15\n";
    scratch.file("servo.toml", servo(KNOWN, ", fixed = true", tables));
    scratch.simulates("servo-real", &[1]);
    let said = scratch.run("audit --model servo.toml run1.csv").stderr;
    let said = String::from_utf8(said).unwrap();
    says(
        &said,
        &["[logs.\"nothing*\"] of the model matches none of these logs"],
    );
    assert!(!said.contains("run*"));
}
