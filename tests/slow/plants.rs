//! Plants in another process, of which tests/clients/plant.py is one: what it does, and what it does wrong.

use std::fs;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use rand::{Rng, RngExt};
use residyn_control::control::Task;
use residyn_core::data::Columns;
use residyn_core::model::Library;
use residyn_core::rng;
use residyn_experiments::experiment::{Config, undeclared_effect};
use residyn_io::{read_plant, read_rig_log};
use serde_json::Value;

use crate::support::clients::{interpreter_for, plants_in};
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

/// The rows of the newest log in the folder of episodes; none before there is a log.
fn rows_of_newest(scratch: &Scratch) -> usize {
    let entries = fs::read_dir(scratch.path("e")).into_iter().flatten();
    let paths = entries.map(|entry| entry.unwrap().path());
    let logs = paths.filter(|path| path.extension().is_some_and(|e| e == "csv"));
    let newest = logs.max();
    newest.map_or(0, |log| {
        read_rig_log(&log, 1, &Columns::default()).map_or(0, |log| log.rows())
    })
}

#[test]
fn a_plan_that_diverges_is_never_sent() {
    let Some(words) = controlling("none") else {
        return;
    };
    let scratch = Scratch::new();
    let endless = "objective = \"1e300 * (1 + q1^2)\"";
    scratch.changed("tasks/pendulum.toml", "objective = \"cos(q1)\"", endless);
    let mut command = scratch.command("");
    let output = command.args(&words).args(["--task", "pendulum.toml"]);
    let output = output.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    says(
        &said,
        &["500 of 500 plan(s) failed", "held its safe command"],
    );
    let log = read_rig_log(scratch.path("e/episode-000.csv"), 1, &Columns::default()).unwrap();
    assert!(log.tau[0].iter().all(|tau| *tau == 0.0));
}

#[test]
fn what_a_model_in_mujoco_hides_is_named_after_an_episode_and_planned_with() {
    let scratch = Scratch::new();
    let Some(environment) = plants_in(&scratch.path("")) else {
        return;
    };
    let config = fs::read_to_string(ours("configs/elsewhere/pendulum.toml")).unwrap();
    let config = config.replace("seeds = 10", "seeds = 1");
    scratch.file("c.toml", config.replace("epochs = 4000", "epochs = 20"));
    fs::create_dir_all(scratch.path("configs/elsewhere")).unwrap();
    let xml = "configs/elsewhere/pendulum.xml";
    fs::copy(ours(xml), scratch.path(xml)).unwrap();
    let mut command =
        scratch.command("experiment undeclared-effect --config c.toml --out x --json");
    let output = command.envs(environment).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let case = &found["cases"][0];
    let of = |model: &str| {
        let mut models = case["models"].as_array().unwrap().iter();
        let of_model = models.find(|entry| entry["model"] == model).unwrap();
        of_model["mean"].as_f64().unwrap()
    };
    let [declared, closed, truth] = ["declared", "closed", "true"].map(of);
    assert!(
        declared < 100.0 && closed >= 0.99 * truth,
        "{declared} {closed} {truth}"
    );
    let named = case["closed"][0][0]["effects"].as_array().unwrap();
    let named: Vec<&str> = named.iter().map(|e| e["name"].as_str().unwrap()).collect();
    // The friction is established on some seeds, and in the model on all.
    assert!(named.contains(&"actuator_delay"), "{named:?}");
}

#[test]
fn an_investigation_names_what_a_rig_hides_and_is_found_again() {
    let scratch = Scratch::new();
    let Some(environment) = plants_in(&scratch.path("")) else {
        return;
    };
    for file in ["joint.xml", "joint-declared.xml", "joint-limits.toml"] {
        fs::copy(ours("configs/elsewhere").join(file), scratch.path(file)).unwrap();
    }
    scratch.answers("new --from-mjcf joint-declared.xml --out joint.toml");
    let run = || -> Value {
        let line = "investigate --model joint.toml --limits joint-limits.toml --motion 64s --out x --json --seed 1 --plant";
        let plant =
            "exec:python -m residyn.plants.mujoco joint.xml --step 0.01 --position-noise 3e-4";
        let mut command = scratch.command(line);
        let output = command
            .arg(plant)
            .envs(environment.clone())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let found = run();
    assert_eq!(found["ended"], "settled");
    let rounds = found["rounds"].as_array().unwrap();
    let named = &rounds[rounds.len() - 1]["established"];
    assert_eq!(
        named,
        &serde_json::json!([{"name": "coulomb_friction", "joint": 1}])
    );
    assert!(scratch.has("x/report/model.toml") && scratch.has("x/report.html"));
    // The same command finds what was done, and plays nothing.
    let before = fs::metadata(scratch.path("x/run-001.csv"))
        .unwrap()
        .modified()
        .unwrap();
    assert_eq!(run(), found);
    let after = fs::metadata(scratch.path("x/run-001.csv"))
        .unwrap()
        .modified()
        .unwrap();
    assert_eq!(before, after);
}

/// A pendulum whose declared model knows no gravity falls out of the motion that it is to follow.
#[test]
fn a_rig_that_runs_away_from_its_motion_is_left_to_its_safe_command() {
    let scratch = Scratch::new();
    scratch.file(
        "declared.toml",
        "[system]\nname = \"pendulum\"\njoints = 1\n[parameters]\nJ = { value = 1 }\n\
         [dynamics]\nmass = [[\"J\"]]\nbias = [\"0\"]\n",
    );
    scratch.file(
        "limits.toml",
        "step_s = 0.01\n[[joint]]\nangle = [-2.0, 2.0]\nspeed = 0.3\nacceleration = 2.0\ntorque = 0.2\nstart = 1.5\n\
         torque_noise = 0.01\nencoder_noise = 1e-4\n",
    );
    let said = scratch.refuses(
        "investigate --plant pendulum --model declared.toml --limits limits.toml --motion 8s --out x",
    );
    assert!(said.contains("run 1: joint 1 moved at "), "{said}");
    assert!(said.contains(" where the limits allow 0.3"), "{said}");
    assert!(!scratch.has("x/rounds.jsonl"));
}

#[test]
fn every_experiment_on_plants_in_other_processes_can_be_read() {
    let entries = fs::read_dir(ours("configs/elsewhere")).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    for path in paths.filter(|path| path.extension() == Some("toml".as_ref())) {
        let name = path.file_stem().unwrap().to_string_lossy();
        match name.rsplit_once('-') {
            Some((_, "learning")) => drop(Config::read(&path).unwrap()),
            Some((_, "plant" | "declared")) => {
                drop(read_plant(&path, &Library::built_in()).unwrap());
            }
            Some((_, "task")) => drop(Task::read(&path).unwrap()),
            // For a model that is made from a description; the guide uses it.
            Some((_, "limits")) => {}
            _ => drop(undeclared_effect::Experiment::read(&path).unwrap()),
        }
    }
}

/// Number of kills in each test of them: `RESIDYN_KILLS`, or enough to see that they are survived.
fn kills() -> usize {
    let asked = std::env::var("RESIDYN_KILLS").ok();
    asked.map_or(12, |count| count.parse().unwrap())
}

/// A host that drives a plant which counts its rows, and its folder.
fn counting() -> Option<(Scratch, Child)> {
    let words = controlling("counting")?;
    let scratch = Scratch::new();
    let mut command = scratch.command("");
    let command = (command.args(&words)).args(["--replan", "1", "--episodes", "99"]);
    let mut host = command
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    until_there(&scratch.path("rows"), &mut host);
    Some((scratch, host))
}

/// Let a random part of an episode or two pass.
fn pass_time(rng: &mut impl Rng) {
    thread::sleep(Duration::from_millis(rng.random_range(0..1200)));
}

/// Whether all rows that a plant has measured are kept, but the two newest.
fn rows_are_kept(scratch: &Scratch) {
    // What `count` wrote before this episode's first row was sent may be of the one before.
    let measured: usize = scratch.read("rows").parse().unwrap();
    let kept = rows_of_newest(scratch);
    assert!(kept + 2 >= measured, "{kept} of {measured} rows are kept");
}

#[test]
fn a_host_that_is_killed_leaves_all_rows_but_the_newest() {
    let mut rng = rng(1);
    for _ in 0..kills() {
        let Some((scratch, mut host)) = counting() else {
            return;
        };
        pass_time(&mut rng);
        host.kill().unwrap();
        host.wait().unwrap();
        // The plant ends when its input does; until then it may measure once more.
        thread::sleep(Duration::from_millis(200));
        rows_are_kept(&scratch);
    }
}

#[test]
fn a_plant_that_is_killed_leaves_all_rows_but_the_newest() {
    let mut rng = rng(2);
    for _ in 0..kills() {
        let Some((scratch, host)) = counting() else {
            return;
        };
        pass_time(&mut rng);
        let killed = Command::new("kill")
            .args(["-9", &scratch.read("pid")])
            .status();
        assert!(killed.unwrap().success());
        let output = host.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        says(
            &said,
            &["the plant ended without a word (signal: 9 (SIGKILL))"],
        );
        assert_eq!(output.status.code(), Some(2));
        rows_are_kept(&scratch);
    }
}

/// The words that name a plant without faults.
fn plant_of_rod() -> Option<String> {
    controlling("none").map(|words| words[words.len() - 1].clone())
}

#[test]
fn a_plant_in_another_process_is_recorded_under_a_multisine() {
    let Some(plant) = plant_of_rod() else {
        return;
    };
    let scratch = Scratch::new();
    let simulate = |words: &str| {
        let mut command = scratch.command(&format!("simulate {words} --out run.csv --plant"));
        command.arg(&plant).output().unwrap()
    };
    for (words, message) in [
        (
            "--duration 2 --effect coulomb_friction=0.1",
            "--effect is for a simulated rig",
        ),
        ("", "add --duration"),
    ] {
        let output = simulate(words);
        assert_eq!(output.status.code(), Some(2));
        says(&String::from_utf8_lossy(&output.stderr), &[message]);
    }
    let recorded = |seed: u32| {
        let output = simulate(&format!("--duration 2 --seed {seed}"));
        assert_eq!(output.status.code(), Some(0));
        read_rig_log(scratch.path("run.csv"), 1, &Columns::default()).unwrap()
    };
    let log = recorded(1);
    assert_eq!(log.rows(), 101);
    let most = log.tau[0]
        .iter()
        .fold(0.0, |most: f64, tau| most.max(tau.abs()));
    assert!((1.0..=3.0).contains(&most), "{most} of 3 N m");
    assert_eq!(recorded(1).tau, log.tau);
    assert_ne!(recorded(2).tau, log.tau);
}

#[test]
fn learning_on_a_plant_in_another_process_goes_on_after_a_kill() {
    let Some(plant) = plant_of_rod() else {
        return;
    };
    let scratch = Scratch::new();
    let mbrl = |out: &str| {
        let config = "--config $REPO/configs/smoke/physics-prior-pendulum.toml";
        let mut command = scratch.command(&format!("mbrl {config} --out {out} --plant"));
        command
            .arg(&plant)
            .stderr(Stdio::null())
            .stdout(Stdio::null());
        command
    };
    assert!(mbrl("whole").status().unwrap().success());
    let mut killed = mbrl("killed").spawn().unwrap();
    until_there(&scratch.path("killed/rounds.jsonl"), &mut killed);
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(mbrl("killed").status().unwrap().success());
    for file in ["rounds.jsonl", "stretch-001.csv", "stretch-004.csv"] {
        let [whole, killed] = ["whole", "killed"].map(|run| scratch.read(&format!("{run}/{file}")));
        assert_eq!(whole, killed, "{file}");
    }
}

#[test]
fn an_experiment_on_a_plant_in_another_process_compares_what_is_known() {
    let Some(plant) = plant_of_rod() else {
        return;
    };
    let scratch = Scratch::new();
    let text = fs::read_to_string(ours("configs/smoke/physics-prior-pendulum.toml")).unwrap();
    let text = text.replace("\"pendulum-real\"", &format!("{plant:?}"));
    let run = |out: &str| {
        let line = format!("experiment physics-prior --config c.toml --out {out} --json");
        let output = scratch.command(&line).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{said}");
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    scratch.file("c.toml", &text);
    let unknown = run("unknown");
    assert!(unknown["methods"].get("perfect").is_none());
    assert!(unknown["reached"]["hybrid"]["final_share_of_perfect"].is_null());
    scratch.file("c.toml", format!("perfect = \"pendulum\"\n{text}"));
    let known = run("known");
    assert!(known["methods"]["perfect"]["return_mean"][0].is_number());
    assert!(known["reached"]["hybrid"]["final_share_of_perfect"].is_number());
    assert_eq!(known["methods"]["hybrid"], unknown["methods"]["hybrid"]);
}
