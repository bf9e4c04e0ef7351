//! Plants in another process, of which tests/clients/plant.py is one: what it does, and what it does wrong.

use std::fs;
use std::process::Stdio;
use std::thread;
use std::time::Duration;

use residyn_core::data::Columns;
use residyn_io::read_rig_log;
use serde_json::Value;

use crate::support::clients::interpreter_for;
use crate::support::paths::ours;
use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, says, until_there};

/// The words that control a plant with this fault; `None` without an interpreter.
fn controlling(fault: &str) -> Option<Vec<String>> {
    let python = interpreter_for("plant.py")?;
    let script = ours("tests/clients/plant.py");
    let command = format!(
        "exec:'{}' '{}' '{fault}'",
        python.display(),
        script.display()
    );
    let line = "control --model pendulum --out e --plant";
    let mut words: Vec<String> = line.split(' ').map(str::to_owned).collect();
    words.push(command);
    Some(words)
}

#[test]
fn a_plant_in_another_process_is_swung_up_and_every_row_is_kept() {
    let Some(words) = controlling("none") else {
        return;
    };
    let scratch = Scratch::new();
    let run = |more: &[&str]| -> Value {
        let mut command = scratch.command("");
        let output = command.args(&words).args(more).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        says(&said, &["stopped"]);
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let found = run(&["--json", "--episodes", "2", "--replan", "5"]);
    assert_eq!(found["successes"], 2, "{found}");
    let path = scratch.path("e/episode-001.csv");
    let text = fs::read_to_string(&path).unwrap();
    assert!(
        text.starts_with("time,q1,qd1,tau1,u_voltage\n0,"),
        "{text:.100}"
    );
    let log = read_rig_log(&path, 1, &Columns::default()).unwrap();
    let total: f64 = log.q[0][1..].iter().map(|q| q.cos()).sum();
    let told = found["episodes"][1]["return"].as_f64().unwrap();
    assert!((total - told).abs() < 1e-9, "{total} {told}");
    assert!(log.tau[0].iter().all(|tau| tau.abs() <= 3.0));
    // The plant's limit of 100 N m a second.
    let changes = log.tau[0].windows(2).map(|pair| (pair[1] - pair[0]).abs());
    assert!(changes.fold(0.0, f64::max) <= 2.0 + 1e-9);
    let again = run(&["--json", "--episodes", "2", "--replan", "5"]);
    assert_eq!(again["return_mean"], found["return_mean"]);
}

/// What a plant does wrong, and words of the message.
const FAULTS: &str = "
mute         | ended without a word
early        | line 1 of the plant: the first message is a hello
protocol     | speaks protocol 2, not 1
no joints    | name each joint
safe         | `safe` has 2 entries for 1 joints
limits       | `limits.command` has [3, -3]
unsafe       | `safe` is outside `limits.command`
step         | step
name         | the name ... is not for people
measured     | use letters, digits and underscores
dies         | ended without a word ... exit status: 3
torn         | ended without a word
closes       | ended without a word
garbage      | line 5 of the plant is not a message
binary       | line 5 of the plant is not a message
long         | longer than 1000000 bytes
deep         | line 5 of the plant is not a message ... sequence
null         | line 5 of the plant is not a message
no rows      | line 5 of the plant: `rows` is empty
type         | unknown variant `row`
hello        | line 5 of the plant: rows were expected
joints       | `q` has 2 numbers for 1 joints
infinite     | out of range
nan          | line 5 of the plant is not a message
huge         | is not a reading
command      | the answer to step 3 ends with a row of command
old command  | the answer to step 3 ends with a row of command
past         | a row at 0 s comes after one at 0.02 s
repeated     | a row at 0.02 s comes after one at 0.02 s
unsolicited  | nothing was asked since its last answer
flood        | nothing was asked since its last answer
error        | the plant reports an error and has stopped: the belt has
";

#[test]
fn a_plant_that_misbehaves_is_survived_and_told_apart() {
    for [fault, words] in rows(FAULTS) {
        let Some(command) = controlling(&fault) else {
            return;
        };
        let scratch = Scratch::new();
        let output = scratch.command("").args(&command).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{fault}: {said}");
        says_words(&said, &words);
        assert!(!said.contains('\u{1b}'), "{fault}: {said}");
        // Rows that were measured before are kept, and readable.
        let log = scratch.path("e/episode-000.csv");
        if log.exists() {
            let rows = read_rig_log(&log, 1, &Columns::default()).map(|log| log.rows());
            assert!(rows.is_ok_and(|rows| rows >= 1), "{fault}");
        }
    }
}

#[test]
fn addresses_and_limits_are_checked_before_a_plant_moves() {
    let Some(command) = controlling("none") else {
        return;
    };
    let scratch = Scratch::new();
    let refused = |plant: &str, more: &str| {
        let words = format!("control {more} --plant");
        let output = scratch.command(&words).arg(plant).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let pendulum = "--model pendulum";
    for (plant, words) in [
        ("exec:", "write the command after `exec:`"),
        ("tcp:192.0.2.1:4000", "another machine"),
        ("tcp:127.0.0.1:9", "cannot be reached"),
    ] {
        says(&refused(plant, pendulum), &[words]);
    }
    let plant = command.last().unwrap();
    let said = refused(plant, "--model acrobot");
    says(
        &said,
        &["the model acrobot has 2 joints, but the plant pendulum in Python has 1"],
    );
    let task = fs::read_to_string(ours("configs/tasks/pendulum.toml")).unwrap();
    scratch.file("slow.toml", task.replace("step_s = 0.02", "step_s = 0.05"));
    let said = refused(plant, "--model pendulum --task slow.toml");
    says(
        &said,
        &["holds a command for 0.05 s, the plant pendulum in Python for 0.02 s"],
    );
}

/// The rows of the newest log in the folder of episodes.
fn rows_of_newest(scratch: &Scratch) -> usize {
    let logs = fs::read_dir(scratch.path("e")).unwrap();
    let paths = logs.map(|entry| entry.unwrap().path());
    let newest = paths.filter(|path| path.extension().is_some_and(|e| e == "csv"));
    let log = read_rig_log(newest.max().unwrap(), 1, &Columns::default());
    log.map_or(0, |log| log.rows())
}

#[test]
fn a_host_that_is_killed_leaves_all_rows_but_the_newest() {
    for kill in 0..20 {
        let Some(words) = controlling("counting") else {
            return;
        };
        let scratch = Scratch::new();
        let mut command = scratch.command("");
        let command = command
            .args(&words)
            .args(["--replan", "1", "--episodes", "99"]);
        let mut host = command
            .stderr(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        until_there(&scratch.path("rows"), &mut host);
        thread::sleep(Duration::from_millis(53 * kill));
        host.kill().unwrap();
        host.wait().unwrap();
        // The plant ends when its input does; until then it may measure once more.
        thread::sleep(Duration::from_millis(200));
        let measured: usize = scratch.read("rows").parse().unwrap();
        let kept = rows_of_newest(&scratch);
        assert!(kept + 2 >= measured, "{kept} of {measured} rows are kept");
    }
}

#[test]
fn a_plant_that_is_killed_leaves_all_rows() {
    for last in (3..200).step_by(9) {
        let Some(words) = controlling(&format!("killed at {last}")) else {
            return;
        };
        let scratch = Scratch::new();
        let output = scratch.command("").args(&words).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        says(
            &said,
            &["the plant ended without a word (signal: 9 (SIGKILL))"],
        );
        assert_eq!(rows_of_newest(&scratch), last - 1);
    }
}
