//! Whole answers on fixed logs, compared with those committed in `tests/golden`: a change that is not meant to change
//! answers changes none of these.
//!
//! `tests/run --bless` rewrites them after an intended change; the difference is then part of the commit.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use crate::support::committed::{difference, is_as_committed, same_but_for_rounding};
use crate::support::paths::ours;
use crate::support::{Scratch, measured};

/// Left out: values that depend on the machine, the time, the version and the paths; values that only draw the numbers;
/// the settings, which are the same in all answers; and the errors with a network, which is trained in single
/// precision: between processors with and without AVX-512 they differ by up to a tenth.
const LEFT_OUT: [&str; 10] = [
    "with",
    "hybrid",
    "settings",
    "call",
    "configuration",
    "version",
    "files",
    "plots",
    "curves",
    "tried",
];

/// Close the loop of a rig, as these words give it, and compare the answer with the committed one of this name.
fn answer_is_as_before(scratch: &Scratch, name: &str, rig: &str) {
    scratch.answers(&format!("closeloop --quiet --seed 1 --out out {rig}"));
    let mut report = scratch.read_json("out/report.json");
    leave_out(&mut report);
    let report = lines(&report, 0) + "\n";
    let model = scratch.read("out/model.toml");
    let (_, model) = model.split_once('\n').unwrap(); // The first line has the version.
    let folder = ours("tests/golden").join(name);
    for (file, found) in [("report.json", report.as_str()), ("model.toml", model)] {
        is_as_committed(&folder.join(file), found, same_but_for_rounding);
    }
}

#[test]
fn numbers_may_be_off_by_rounding_and_words_may_not() {
    let wanted = "F_c1 = { value = 0.16033436842865145, ci95 = [-1e-9, 0] }";
    for (from, to, is_same) in [
        ("0.16033436842865145", "0.16033436842865999", true),
        ("0.16033436842865145", "0.1603345", true),
        ("0.16033436842865145", "0.160335", false),
        ("-1e-9", "1e-9", false),
        ("0]", "1e-300]", false),
        ("F_c1", "F_c2", false),
        ("]", "", false),
    ] {
        let found = wanted.replace(from, to);
        assert_eq!(same_but_for_rounding(wanted, &found), is_same, "{to}");
    }
    let difference = |found: &str| difference("a\nb", found, same_but_for_rounding);
    assert_eq!(difference("a\nb"), None);
    assert!(difference("a").unwrap().contains("line 2"));
}

fn leave_out(value: &mut Value) {
    match value {
        Value::Object(entries) => {
            entries.retain(|key, _| !LEFT_OUT.contains(&key.as_str()));
            entries.values_mut().for_each(leave_out);
        }
        Value::Array(entries) => entries.iter_mut().for_each(leave_out),
        _ => (),
    }
}

/// JSON in lines that are short enough to read and long enough to be few.
fn lines(value: &Value, depth: usize) -> String {
    let short = value.to_string();
    let (indent, end) = ("  ".repeat(depth + 1), "  ".repeat(depth));
    let entries: Vec<String> = match value {
        Value::Object(entries) if short.len() > 100 => entries
            .iter()
            .map(|(key, entry)| format!("{indent}{key:?}: {}", lines(entry, depth + 1)))
            .collect(),
        Value::Array(entries) if short.len() > 100 => entries
            .iter()
            .map(|entry| format!("{indent}{}", lines(entry, depth + 1)))
            .collect(),
        _ => return short,
    };
    let brackets = if value.is_array() { "[]" } else { "{}" };
    let (open, close) = brackets.split_at(1);
    format!("{open}\n{}\n{end}{close}", entries.join(",\n"))
}

/// Four logs of 6 s of a plant, the last of which is the test log; and the answer on them. Words for the plant's effects
/// may follow it.
fn simulated(name: &str, model: &str, plant: &str) {
    let scratch = Scratch::new();
    scratch.simulates(&format!("{plant} --quiet --duration 6"), &[1, 2, 3, 4]);
    let logs = "--train run1.csv run2.csv run3.csv --test run4.csv";
    answer_is_as_before(&scratch, name, &format!("--model {model} {logs}"));
}

/// A file of the folder of committed logs.
fn small(name: &str) -> PathBuf {
    ours("tests/fixtures/logs").join(name)
}

/// The two-link arm whose log is committed.
fn write_small_arm(scratch: &Scratch) {
    let urdf = "$REPO/tests/fixtures/mechanisms/planar_2r.urdf";
    scratch.succeeds(&format!(
        "new --quiet --from-urdf {urdf} --out planar_2r.toml"
    ));
}

/// The answer for a committed log.
fn of_small_log(scratch: &Scratch, rig: &str, model: &str) {
    let log = format!("$REPO/tests/fixtures/logs/{rig}.csv");
    let given = format!("--model {model} --train {log}");
    answer_is_as_before(scratch, &format!("small_{rig}"), &given);
}

#[test]
fn small_pendulum() {
    of_small_log(&Scratch::new(), "pendulum", "pendulum");
}

#[test]
fn small_servo() {
    of_small_log(&Scratch::new(), "servo", "servo");
}

#[test]
fn small_arm() {
    let scratch = Scratch::new();
    write_small_arm(&scratch);
    of_small_log(&scratch, "arm", "planar_2r.toml");
}

#[test]
fn the_committed_logs_are_what_their_plants_write() {
    let scratch = Scratch::new();
    write_small_arm(&scratch);
    for name in ["pendulum", "servo", "arm"] {
        let [plant, log] = ["toml", "csv"].map(|kind| format!("{name}.{kind}"));
        fs::copy(small(&plant), scratch.path(&plant)).unwrap();
        let simulate = format!("simulate --quiet --plant {plant} --seed 1 --out {log}");
        scratch.succeeds(&simulate);
        is_as_committed(&small(&log), &scratch.read(&log), same_but_for_rounding);
    }
}

#[test]
fn demo() {
    answer_is_as_before(&Scratch::new(), "demo", "");
}

/// A pendulum with effects that its model does not declare.
fn pendulum_with(name: &str, effects: &str) {
    let plant = format!("pendulum --effect {effects}");
    simulated(&format!("pendulum_with_{name}"), "pendulum", &plant);
}

#[test]
fn pendulum_with_dry_friction() {
    pendulum_with("dry_friction", "coulomb_friction=0.16");
}

#[test]
fn pendulum_with_drag() {
    pendulum_with("drag", "quadratic_drag=0.05");
}

#[test]
fn pendulum_with_two_kinds_of_friction() {
    pendulum_with(
        "two_kinds_of_friction",
        "coulomb_friction=0.12 viscous_friction=0.05",
    );
}

#[test]
fn pendulum_with_a_delay() {
    pendulum_with("a_delay", "actuator_delay=0.02");
}

#[test]
fn servo() {
    simulated("servo", "servo", "$REPO/configs/plants/servo-real.toml");
}

mod slow {
    use super::*;

    /// An acrobot with effects that its model does not declare.
    fn acrobot_with(name: &str, effects: &str) {
        let plant = format!("acrobot --effect {effects}");
        simulated(&format!("acrobot_with_{name}"), "acrobot", &plant);
    }

    #[test]
    fn acrobot_with_dry_friction() {
        acrobot_with("dry_friction", "coulomb_friction@2=0.15");
    }

    #[test]
    fn acrobot_with_friction_and_a_spring() {
        acrobot_with(
            "friction_and_a_spring",
            "viscous_friction@1=0.1 joint_spring@2=0.4",
        );
    }

    /// The answer for measured logs: the last is the test log where there are several.
    fn measured_rig(scratch: &Scratch, name: &str, set: &str, model: &str, logs: &[&str]) {
        let Some(folder) = measured(set) else { return };
        for log in logs {
            fs::copy(folder.join(log), scratch.path(log)).unwrap();
        }
        let given = match logs {
            [only] => format!("--train {only}"),
            [train @ .., test] => format!("--train {} --test {test}", train.join(" ")),
            [] => panic!("no logs"),
        };
        answer_is_as_before(scratch, name, &format!("--model {model} {given}"));
    }

    /// An arm from the URDF that lies next to its logs.
    fn arm(name: &str, logs: &[&str]) {
        let Some(folder) = measured(name) else { return };
        let scratch = Scratch::new();
        scratch.new_model(&folder.join(format!("{name}.urdf")));
        let model = format!("{name}.toml");
        fs::rename(scratch.path("model.toml"), scratch.path(&model)).unwrap();
        measured_rig(&scratch, name, name, &model, logs);
    }

    #[test]
    fn panda() {
        arm("panda", &["exciting_trajectory.csv"]);
    }

    #[test]
    fn kuka_lwr4() {
        arm("kuka_lwr4", &["measurements_1.csv", "measurements_2.csv"]);
    }

    #[test]
    fn dfki_simple_pendulum() {
        let name = "dfki_simple_pendulum";
        let logs = ["ddp_pd_tracking.csv", "direct_collocation_pd_tracking.csv"];
        measured_rig(&Scratch::new(), name, name, "pendulum", &logs);
    }

    #[test]
    fn dfki_double_pendulum() {
        let model = "$REPO/docs/rigs/dfki_double_pendulum.toml";
        let logs = ["sysid_00.csv", "sysid_03.csv", "sysid_05.csv"];
        let (name, set) = ("dfki_double_pendulum", "dfki_double_pendulum_c0");
        measured_rig(&Scratch::new(), name, set, model, &logs);
    }
}
