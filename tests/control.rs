//! `residyn control`, `mbrl` and `experiment`, through the binary.

use std::fs;
use std::path::Path;
use std::time::Duration;

use residyn_core::data::Columns;
use residyn_core::model::Library;
use residyn_experiments::experiment::{Config, Session};
use residyn_io::read_rig_log;
use residyn_io::runs::Shard;
use residyn_train::recipe::{Job, Recipe};
use residyn_train::{Backend, Checkpoint};
use serde_json::Value;

use crate::support::in_folder::{json, kill_after, refused, residyn};
use crate::support::paths::{config, configs};

fn shipped(name: &str) -> String {
    let checkpoints = Path::new(env!("CARGO_MANIFEST_DIR")).join("checkpoints");
    checkpoints.join(name).display().to_string()
}

#[test]
fn a_model_swings_up_its_own_plant_and_the_episode_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let command = [
        "control",
        "--model",
        "pendulum",
        "--plant",
        "pendulum-sim",
        "--out",
        "e",
    ];
    let found = json(
        dir.path(),
        &[command.as_slice(), &["--episodes", "2"]].concat(),
    );
    let episodes = found["episodes"].as_array().unwrap();
    assert_eq!(episodes.len(), 2);
    for (number, episode) in episodes.iter().enumerate() {
        assert_eq!(episode["success"], true, "{found}");
        assert_eq!(episode["decisions"], 10);
        let log = dir.path().join(format!("e/episode-{number:03}.csv"));
        let log = read_rig_log(&log, 1, &Columns::default()).unwrap();
        assert_eq!(log.rows(), 501);
        // Without noise the log holds the true states; rewards are taken after each step.
        let total: f64 = log.q[0][1..].iter().map(|q| q.cos()).sum();
        let message = episode["return"].as_f64().unwrap();
        assert!((total - message).abs() < 1e-9, "{total} {message}");
        assert!(message > 290.0, "{message}");
        let plot =
            fs::read_to_string(dir.path().join(format!("e/episode-{number:03}.svg"))).unwrap();
        assert!(plot.contains("position q1 (rad)"), "{plot:.300}");
    }
    let again = json(
        dir.path(),
        &[command.as_slice(), &["--episodes", "2"]].concat(),
    );
    assert_eq!(again["return_mean"], found["return_mean"]);
    let other = json(dir.path(), &[command.as_slice(), &["--seed", "1"]].concat());
    assert_ne!(other["return_mean"], found["return_mean"]);
}

#[test]
fn options_change_the_plant() {
    let dir = tempfile::tempdir().unwrap();
    let command = [
        "control",
        "--model",
        "pendulum",
        "--plant",
        "pendulum-real",
        "--out",
        "e",
    ];
    let options = [
        "--start", "0.1", "-0.2", "--torque", "2", "--replan", "5", "--noise", "0.01", "0.1",
    ];
    let found = json(dir.path(), &[command.as_slice(), &options].concat());
    assert_eq!(found["episodes"][0]["decisions"], 100);
    let log = read_rig_log(dir.path().join("e/episode-000.csv"), 1, &Columns::default()).unwrap();
    let start = [log.q[0][0] - 0.1, log.qd[0][0] + 0.2];
    assert!(
        start[0] != 0.0 && start[0].abs() < 0.05 && start[1].abs() < 0.5,
        "{start:?}"
    );
    assert!(log.tau[0].iter().all(|tau| tau.abs() <= 2.0));
    // Near upright, replanning every 0.1 s, it stays there despite friction that the model lacks.
    assert_eq!(found["episodes"][0]["success"], true, "{found}");
}

#[test]
fn control_refuses_other_systems_tasks_and_settings() {
    let dir = tempfile::tempdir().unwrap();
    let message = |arguments: &[&str]| refused(dir.path(), &[&["control"], arguments].concat());
    let other = message(&["--model", "acrobot", "--plant", "pendulum-real"]);
    assert!(
        other.contains("the model acrobot has 2 joints, but the plant pendulum has 1"),
        "{other}"
    );
    let none = message(&["--model", "cartpole", "--plant", "cartpole"]);
    assert!(
        none.contains("no built-in task is for cartpole; give a task file"),
        "{none}"
    );
    let far = message(&[
        "--model",
        "pendulum",
        "--plant",
        "pendulum-real",
        "--replan",
        "81",
    ]);
    assert!(
        far.contains("`replan` is 81, but a plan has 80 steps"),
        "{far}"
    );
    fs::write(
        dir.path().join("t.toml"),
        "system = \"pendulum\"\nreward = 1\n",
    )
    .unwrap();
    let key = message(&[
        "--model", "pendulum", "--plant", "pendulum", "--task", "t.toml",
    ]);
    assert!(
        key.contains("t.toml: ") && key.contains("line 2") && key.contains("reward"),
        "{key}"
    );
    assert_eq!(
        fs::read_dir(dir.path()).unwrap().count(),
        1,
        "nothing is written"
    );
}

/// The command line of an experiment.
fn experiment<'a>(name: &'a str, config: &'a str, out: &'a str) -> [&'a str; 6] {
    ["experiment", name, "--config", config, "--out", out]
}

/// The error of a recipe's run on other data, and the resulting model.
fn trained_again(recipe: &str) -> (f64, tempfile::TempDir) {
    let dir = tempfile::tempdir().unwrap();
    let found = json(
        dir.path(),
        &["train", "--config", &config(recipe), "--out", "c"],
    );
    (found["test_error"]["after"].as_f64().unwrap(), dir)
}

/// A checkpoint's error on the same data.
fn error_of(checkpoint: &Checkpoint, recipe: &str) -> f64 {
    let recipe = Recipe::read(&configs().join(recipe)).unwrap();
    let job = Job::train(recipe, &Library::built_in(), Backend::NdArray, 0).unwrap();
    let training = checkpoint
        .training(&job_dynamics(&job), &Backend::NdArray.device())
        .unwrap();
    let outcome = job.results(&training, Path::new("shipped")).unwrap();
    outcome.test_error.unwrap().after
}

fn job_dynamics(job: &Job) -> residyn_core::model::Dynamics {
    let name = job.model.system().to_owned();
    Library::built_in().model(&name).unwrap().dynamics()
}

/// Rounding differs between processors and grows over thousands of epochs, so the model's accuracy must be reproducible
/// everywhere; on the machine that made it, the model is reproducible bit for bit.
fn comes_again(name: &str, recipe: &str, most: f64) {
    let checkpoint = Checkpoint::load(Path::new(&shipped(name))).unwrap();
    let shipped = error_of(&checkpoint, recipe);
    let (again, _) = trained_again(recipe);
    assert!(shipped < most, "{name}: {shipped:e}");
    let ratio = again / shipped;
    assert!(
        (0.2..5.0).contains(&ratio),
        "{name}: {shipped:e}, again {again:e}"
    );
    let seen = &checkpoint.manifest.config["recipe"];
    let recipe = serde_json::to_value(Recipe::read(&configs().join(recipe)).unwrap()).unwrap();
    assert_eq!(*seen, recipe, "{name} was made by another recipe");
}

/// The smaller return of two episodes with a shipped checkpoint on the plant that it was trained on.
fn least_return(name: &str) -> f64 {
    let dir = tempfile::tempdir().unwrap();
    let command = [
        "control",
        "--checkpoint",
        &shipped(name),
        "--plant",
        name,
        "--episodes",
        "2",
    ];
    let found = json(dir.path(), &command);
    let episodes = found["episodes"].as_array().unwrap().iter();
    episodes
        .map(|e| e["return"].as_f64().unwrap())
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn every_experiment_is_sound() {
    let library = Library::built_in();
    let mut count = 0;
    for name in ["physics-prior", "offline-prior", "receding-horizon"] {
        for entry in fs::read_dir(configs().join(name)).unwrap() {
            let config = Config::read(&entry.unwrap().path()).unwrap();
            assert!(config.seeds >= 10, "{}", config.path.display());
            assert!(
                Session::open(config, &library, Backend::NdArray, 0)
                    .unwrap()
                    .rounds(Shard::WHOLE)
                    > 0
            );
            count += 1;
        }
    }
    assert!(count >= 8);
}

#[test]
fn a_folder_of_another_experiment_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(configs().join("smoke/receding-horizon-pendulum.toml")).unwrap();
    fs::write(dir.path().join("c.toml"), &text).unwrap();
    let command = experiment("receding-horizon", "c.toml", "x");
    let found = json(dir.path(), &command);
    assert_eq!(found["receding_horizon"], serde_json::json!([25, 50]));
    assert_eq!(
        found["methods"]["perfect"]["return_mean"]
            .as_array()
            .unwrap()
            .len(),
        2
    );
    fs::write(
        dir.path().join("c.toml"),
        text.replace("epochs = 300", "epochs = 301"),
    )
    .unwrap();
    let message = refused(dir.path(), &command);
    assert!(
        message.contains("x holds another run: ") && message.contains("epochs"),
        "{message}"
    );
    fs::write(
        dir.path().join("c.toml"),
        text.replace("gather = 50", "gather = 70"),
    )
    .unwrap();
    let message = refused(dir.path(), &command);
    assert!(
        message.contains("c.toml: `gather` is 70, but an episode of pendulum has 500 steps"),
        "{message}"
    );
}

#[test]
fn a_checkpoint_serves_as_prior_in_its_own_experiment_alone() {
    let dir = tempfile::tempdir().unwrap();
    let config = config("smoke/offline-prior-pendulum.toml");
    let found = json(dir.path(), &experiment("offline-prior", &config, "x"));
    let prior = found["methods"]["prior"]["return_mean"][0]
        .as_f64()
        .unwrap();
    let perfect = found["methods"]["perfect"]["return_mean"][0]
        .as_f64()
        .unwrap();
    assert!(prior < 0.0 && perfect > 290.0, "{prior} {perfect}");
    let wrong = refused(dir.path(), &experiment("physics-prior", &config, "y"));
    assert!(
        wrong.contains("physics-prior needs a method whose prior is equations"),
        "{wrong}"
    );
}

mod slow {
    use super::*;

    #[test]
    fn the_shipped_pendulum_checkpoint_is_reproduced_and_swings_up() {
        comes_again("pendulum-sim", "train-pendulum-sim.toml", 1e-6);
        assert!(least_return("pendulum-sim") > 290.0);
    }

    #[test]
    fn the_shipped_acrobot_checkpoint_is_reproduced_and_swings_up() {
        comes_again("acrobot-sim", "train-acrobot-sim.toml", 1e-4);
        assert!(least_return("acrobot-sim") > 3400.0);
    }

    #[test]
    fn a_killed_experiment_resumes_to_the_same_numbers() {
        let config = config("smoke/physics-prior-pendulum.toml");
        let (whole, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let command = experiment("physics-prior", &config, "x");
        let expected = json(whole.path(), &command);
        for file in ["hybrid-00/rounds.jsonl", "data_driven-00/rounds.jsonl"] {
            let file = killed.path().join("x/runs").join(file);
            kill_after(&mut residyn(killed.path(), &command), &file, Duration::ZERO);
        }
        let found = json(killed.path(), &command);
        assert_eq!(found["methods"], expected["methods"]);
        assert_eq!(found["reached"], expected["reached"]);
        for name in ["prior", "data_driven", "hybrid", "perfect"] {
            let course = &found["methods"][name];
            let entries = course["transitions"].as_array().unwrap().len();
            for key in ["return_mean", "return_std", "returns", "success"] {
                assert_eq!(
                    course[key].as_array().unwrap().len(),
                    entries,
                    "{name} {key}"
                );
            }
            assert_eq!(course["returns"][0].as_array().unwrap().len(), 2);
            let [a, b] = [0, 1].map(|seed| course["returns"][0][seed].as_f64().unwrap());
            let mean = course["return_mean"][0].as_f64().unwrap();
            assert!((mean - 0.5 * (a + b)).abs() < 1e-9);
        }
        assert_eq!(
            found["methods"]["hybrid"]["transitions"],
            serde_json::json!([50, 100, 150, 200])
        );
        assert!(found["wall_s"].as_f64().unwrap() > 0.0);
        let command_told = found["command"].as_str().unwrap();
        assert!(
            command_told.starts_with("residyn experiment physics-prior --config "),
            "{command_told}"
        );
        let written: Value =
            serde_json::from_slice(&fs::read(killed.path().join("x/results.json")).unwrap())
                .unwrap();
        assert_eq!(written, found);
        assert!(killed.path().join("x/results.svg").is_file());
        crate::support::clients::look_at(&killed.path().join("x/report.html"));
        let stretch = killed.path().join("x/runs/hybrid-01/stretch-003.csv");
        assert_eq!(
            read_rig_log(&stretch, 1, &Columns::default())
                .unwrap()
                .rows(),
            51
        );
    }

    #[test]
    fn a_single_run_reports_its_rounds() {
        let dir = tempfile::tempdir().unwrap();
        let config = config("smoke/physics-prior-pendulum.toml");
        let command = ["mbrl", "--config", &config, "--out", "r", "--seed", "3"];
        let found = json(dir.path(), &command);
        let lines = fs::read_to_string(dir.path().join("r/rounds.jsonl")).unwrap();
        let lines: Vec<Value> = lines
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        assert_eq!(found["rounds"].as_array().unwrap(), &lines);
        assert_eq!(lines.len(), 4);
        let again = json(dir.path(), &command);
        assert_eq!(again["rounds"], found["rounds"], "nothing is left to do");
        let unknown = refused(
            dir.path(),
            &[
                "mbrl", "--config", &config, "--method", "mine", "--out", "s",
            ],
        );
        assert!(
            unknown.contains("it has no method `mine`; choose from hybrid, data_driven"),
            "{unknown}"
        );
    }
}
