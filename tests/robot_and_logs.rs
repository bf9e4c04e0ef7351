//! A robot description, a folder of logs and the gains of its drives are a complete call.

use std::fs;
use std::path::Path;

use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, says};

/// A rod on a servo of 20 N m/rad and 1 N m s/rad, with dry friction that its description lacks.
const PLANT: &str = r#"
model = "rod.toml"

[[effect]]
name = "coulomb_friction"
joint = 1
F_c = 0.4

[sensor]
rate_hz = 100
position_noise = 2e-4
position_step = 1e-4

[excitation]
amplitude = [1.0]
band_hz = [0.1, 2.0]
tones = 6

[recording]
logs = 3
duration_s = 8
start = [0, 0]
"#;

/// A folder with `rod.urdf`, the model file that `new` makes of it, and the folder `logs` with logs of these names.
fn rig(names: &[&str]) -> Scratch {
    let scratch = Scratch::new();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    fs::copy(fixtures.join("rod.urdf"), scratch.path("rod.urdf")).unwrap();
    scratch.succeeds("new --from-urdf rod.urdf --kp 20 --kd 1 --out rod.toml");
    scratch.file("plant.toml", PLANT);
    fs::create_dir(scratch.path("logs")).unwrap();
    for (seed, name) in names.iter().enumerate() {
        scratch.succeeds(&format!(
            "simulate --plant plant.toml --seed {seed} --out logs/{name}"
        ));
    }
    scratch.file("logs/README.md", "Not a log.");
    scratch
}

/// Commands, and words of their messages.
const REFUSED: &str = "
closeloop rod.urdf                                          | required arguments were not provided ... <LOGS>
closeloop rod.urdf logs --kp 20                             | --kd
closeloop rod.urdf logs --kp 20,30 --kd 1                   | --kp: 2 gains for 1 joints; give one for all, or one for each: pivot
closeloop rod.urdf logs --kp=-1 --kd 1                      | '-1' for '--kp ... not below zero
closeloop rod.toml logs --kp 20 --kd 1                      | gains of a robot description ... its [parameters]
closeloop --model rod.toml --train logs --kp 20 --kd 1      | gains of a robot description
closeloop --kp 20 --kd 1                                    | gains of a robot description
closeloop absent.urdf logs --kp 20 --kd 1                   | absent.urdf: cannot be read
closeloop page.html logs --kp 20 --kd 1                     | page.html, line 1, column 1: the root element is <html>
closeloop rod.urdf logs --model rod.toml --train logs       | cannot be used with
closeloop rod.urdf empty --kp 20 --kd 1                     | empty: is a folder without logs: no file in it ends in ... .csv
audit empty                                                 | empty: is a folder without logs
evaluate --model rod.toml --test empty                      | empty: is a folder without logs
new --from-urdf rod.urdf --drive dc_motor --kp 20 --kd 1    | cannot be used with
";

#[test]
fn what_is_missing_is_said_in_a_line() {
    let scratch = rig(&["run.csv"]);
    fs::create_dir(scratch.path("empty")).unwrap();
    scratch.file("page.html", "<html></html>");
    let there = scratch.count();
    for [line, words] in rows(REFUSED) {
        says_words(&scratch.refuses(&line), &words);
    }
    assert_eq!(scratch.count(), there);
}

#[test]
fn known_gains_are_held_in_fits() {
    let model = rig(&[]).read("rod.toml");
    says(
        &model,
        &[
            "kp_1 = { value = 20.0, unit = \"N m/rad\"",
            "fixed = true }\nkd_1 = { value = 1.0,",
            "tau1 = \"kp_1 * (cmd1 - q1) - kd_1 * qd1\"",
        ],
    );
}

#[test]
fn a_folder_of_logs_is_its_logs() {
    let scratch = rig(&["b.csv", "a.csv"]);
    let names = |evaluated: &serde_json::Value| {
        let logs = evaluated["logs"].as_array().unwrap().iter();
        logs.map(|log| log["name"].as_str().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    let evaluated = scratch.json("evaluate --model rod.toml --test logs");
    assert_eq!(names(&evaluated), ["a.csv", "b.csv"]);
    let audits = scratch.json("audit --model rod.toml logs");
    assert_eq!(audits.as_array().unwrap().len(), 2);
}

mod slow {
    use super::*;

    #[test]
    fn a_robot_its_logs_and_its_gains_are_a_complete_call() {
        let scratch = rig(&["a.csv", "b.csv", "c.csv"]);
        scratch.succeeds("closeloop rod.urdf logs --kp 20 --kd 1 --out report");
        let report = scratch.read_json("report/report.json");
        let found = report["effects"].as_array().unwrap();
        assert!(
            found.len() == 1 && found[0]["name"] == "coulomb_friction",
            "{found:?}"
        );
        // What `new` writes, beside the report.
        assert_eq!(
            scratch.read("report/declared.toml"),
            scratch.read("rod.toml")
        );
        // The same as the long way.
        scratch.succeeds("closeloop --model report/declared.toml --train logs --out long");
        let long = scratch.read_json("long/report.json");
        assert_eq!(long["effects"], report["effects"]);
    }
}
