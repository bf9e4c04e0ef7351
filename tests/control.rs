//! `residyn control`, `mbrl` and `experiment`, through the binary.

use std::fs;
use std::path::Path;
use std::time::Duration;

use residyn_control::plan::Method;
use residyn_core::data::Columns;
use residyn_core::model::Library;
use residyn_experiments::experiment::{Config, Session};
use residyn_io::read_rig_log;
use residyn_io::runs::Shard;
use residyn_plants::Reach;
use residyn_train::recipe::{Job, Recipe};
use residyn_train::{Backend, Checkpoint};
use serde_json::Value;

use crate::support::in_folder::{json, kill_after, refused};
use crate::support::paths::{config, configs, ours};
use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, says};

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
    let scratch = Scratch::new();
    let options = "--start 0.1 -0.2 --torque 2 --replan 5 --noise 0.01 0.1";
    let line = "control --model pendulum --plant pendulum-real --out e";
    let found = scratch.json(&format!("{line} {options}"));
    assert_eq!(found["episodes"][0]["decisions"], 100);
    let log = scratch.path("e/episode-000.csv");
    let log = read_rig_log(log, 1, &Columns::default()).unwrap();
    let start = [log.q[0][0] - 0.1, log.qd[0][0] + 0.2];
    assert!(
        start[0] != 0.0 && start[0].abs() < 0.05 && start[1].abs() < 0.5,
        "{start:?}"
    );
    assert!(log.tau[0].iter().all(|tau| tau.abs() <= 2.0));
    // Near upright, replanning every 0.1 s, it stays there despite friction that the model lacks.
    assert_eq!(found["episodes"][0]["success"], true, "{found}");
}

/// Flags of `residyn control`, and words of the message.
const REFUSED: &str = "
--model acrobot --plant pendulum-real               | the model acrobot has 2 joints, but the plant pendulum has 1
--model cartpole --plant cartpole                   | no built-in task is for cartpole; give a task file
--model pendulum --plant pendulum-real --torque 2 2 | `torque` needs a range for each of 1 joints, found 2
--model pendulum --plant pendulum-real --replan 81  | `replan` is 81, but a plan has 80 steps
--model pendulum --plant pendulum --task t.toml     | t.toml: ... line 2 ... reward
";

#[test]
fn control_refuses_other_systems_tasks_and_settings() {
    let scratch = Scratch::new();
    scratch.file("t.toml", "system = \"pendulum\"\nreward = 1\n");
    for [flags, words] in rows(REFUSED) {
        says_words(&scratch.refuses(&format!("control {flags}")), &words);
    }
    assert_eq!(scratch.count(), 1, "nothing is written");
}

#[test]
fn a_joint_without_a_motor_gets_no_torque() {
    let task = fs::read_to_string(config("tasks/acrobot-swingup.toml")).unwrap();
    let task = task.replace("steps = 1000", "steps = 40");
    let passive = task.replace("[[-3.0, 3.0], [-3.0, 3.0]]", "[[0.0, 0.0], [-3.0, 3.0]]");
    assert_ne!(task, passive);
    for method in Method::names() {
        let scratch = Scratch::new();
        scratch.file("t.toml", &passive);
        let line = "control --model acrobot --plant acrobot-sim --task t.toml --out e --method";
        scratch.succeeds(&format!("{line} {method}"));
        let log = read_rig_log(scratch.path("e/episode-000.csv"), 2, &Columns::default()).unwrap();
        assert!(log.tau[0].iter().all(|tau| *tau == 0.0), "{method}");
        assert!(log.tau[1].iter().any(|tau| *tau != 0.0), "{method}");
    }
}

/// The error of a recipe's run on other data.
fn trained_again(recipe: &str) -> f64 {
    let line = format!("train --config $REPO/configs/{recipe} --out c");
    let found = Scratch::new().json(&line);
    found["test_error"]["after"].as_f64().unwrap()
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
    let checkpoint = Checkpoint::load(&ours("checkpoints").join(name)).unwrap();
    let shipped = error_of(&checkpoint, recipe);
    let again = trained_again(recipe);
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
    let given = format!("--checkpoint $REPO/checkpoints/{name} --plant {name}");
    let found = Scratch::new().json(&format!("control {given} --episodes 2"));
    let episodes = found["episodes"].as_array().unwrap().iter();
    episodes
        .map(|e| e["return"].as_f64().unwrap())
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn every_experiment_is_sound() {
    let (library, scratch) = (Library::built_in(), Scratch::new());
    let mut count = 0;
    for name in ["physics-prior", "offline-prior", "receding-horizon"] {
        for entry in fs::read_dir(configs().join(name)).unwrap() {
            let mut path = entry.unwrap().path();
            if name != "offline-prior" {
                // Read from another folder: what it names is built in. Other priors are files of the project.
                let copy = scratch.path("experiment.toml");
                fs::copy(&path, &copy).unwrap();
                path = copy;
            }
            let config = Config::read(&path).unwrap();
            assert!(config.seeds >= 10, "{}", config.path.display());
            assert!(
                Session::open(config, &library, Backend::NdArray, 0, Reach::Here)
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
    let scratch = Scratch::new();
    let text = fs::read_to_string(configs().join("smoke/receding-horizon-pendulum.toml")).unwrap();
    scratch.file("c.toml", &text);
    let line = "experiment receding-horizon --config c.toml --out x";
    let found = scratch.json(line);
    assert_eq!(found["receding_horizon"], serde_json::json!([25, 50]));
    let returns = &found["methods"]["perfect"]["return_mean"];
    assert_eq!(returns.as_array().unwrap().len(), 2);
    for [from, to, words] in rows(
        "epochs = 300 | epochs = 301 | x holds another run:  ... epochs
         gather = 50  | gather = 70  | c.toml: `gather` is 70, but an episode of pendulum has 500 steps",
    ) {
        scratch.file("c.toml", text.replace(&from, &to));
        says_words(&scratch.refuses(line), &words);
    }
}

#[test]
fn a_checkpoint_serves_as_prior_in_its_own_experiment_alone() {
    let scratch = Scratch::new();
    let config = "--config $REPO/configs/smoke/offline-prior-pendulum.toml";
    let found = scratch.json(&format!("experiment offline-prior {config} --out x"));
    let of = |method: &str| {
        let returns = &found["methods"][method]["return_mean"];
        returns[0].as_f64().unwrap()
    };
    let (prior, perfect) = (of("prior"), of("perfect"));
    assert!(prior < 0.0 && perfect > 290.0, "{prior} {perfect}");
    let wrong = scratch.refuses(&format!("experiment physics-prior {config} --out y"));
    says(
        &wrong,
        &["physics-prior needs a method whose prior is equations"],
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
        let config = "--config $REPO/configs/smoke/physics-prior-pendulum.toml";
        let line = format!("experiment physics-prior {config} --out x");
        let [whole, killed] = [(); 2].map(|()| Scratch::new());
        let expected = whole.json(&line);
        for file in ["hybrid-00/rounds.jsonl", "data_driven-00/rounds.jsonl"] {
            let file = killed.path("x/runs").join(file);
            kill_after(&mut killed.command(&line), &file, Duration::ZERO);
        }
        let found = killed.json(&line);
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
        let command = found["command"].as_str().unwrap();
        let begins = "residyn experiment physics-prior --config ";
        assert!(command.starts_with(begins), "{command}");
        assert_eq!(killed.read_json("x/results.json"), found);
        assert!(killed.path("x/results.svg").is_file());
        crate::support::clients::look_at(&killed.path("x/report.html"));
        let stretch = killed.path("x/runs/hybrid-01/stretch-003.csv");
        let stretch = read_rig_log(&stretch, 1, &Columns::default()).unwrap();
        assert_eq!(stretch.rows(), 51);
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
