//! `residyn train` and `residyn tune`, through the binary if the command line matters.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use residyn_core::model::Library;
use residyn_io::runs::RunFolder;
use residyn_train::recipe::{Job, Recipe, TrainingResults};
use residyn_train::{Backend, Penalty};
use serde_json::Value;

use crate::support::in_folder::{json, kill_after, refused, residyn, run};
use crate::support::paths::{config, configs};

/// A recipe run in this process.
fn train(recipe: Recipe, backend: Backend) -> TrainingResults {
    let job = Job::train(recipe, &Library::built_in(), backend, 0).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let folder = RunFolder::open(dir.path()).unwrap();
    let mut training = job.begin(&folder).unwrap();
    let mut observer = |_: &residyn_train::Progress| ControlFlow::Continue(());
    training
        .run(&job.data.training, None, &mut observer)
        .unwrap();
    job.results(&training, dir.path()).unwrap()
}

fn recipe(name: &str) -> Recipe {
    Recipe::read(&configs().join(name)).unwrap()
}

/// The relative error of the worst parameter.
fn worst(outcome: &TrainingResults) -> f64 {
    let off = |p: &residyn_train::recipe::FittedParameter| {
        let truth = p.truth.unwrap();
        ((p.found - truth) / truth).abs()
    };
    outcome.parameters.iter().map(off).fold(0.0, f64::max)
}

#[test]
fn a_checkpoint_of_another_run_is_not_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let config = config("smoke/train-pendulum.toml");
    let command = ["train", "--config", &config, "--out", "pendulum"];
    let first = json(dir, &command);
    // The same command again returns at once, although the folder now has the name of a built-in system.
    assert_eq!(json(dir, &command), first);
    let before = std::fs::read(dir.join("pendulum/weights.safetensors")).unwrap();
    let message = refused(dir, &[command.as_slice(), &["--seed", "7"]].concat());
    assert_eq!(
        message,
        "error: pendulum holds another run: its `seed` is 0, here it is 7; give another \
         folder with --out, or remove this one to start over\n"
    );
    let text = std::fs::read_to_string(&config).unwrap();
    let longer = text.replace("epochs = 200", "epochs = 300");
    let longer = longer.replace(
        "../plants/",
        &format!("{}/", configs().join("plants").display()),
    );
    std::fs::write(dir.join("longer.toml"), longer).unwrap();
    let message = refused(
        dir,
        &["train", "--config", "longer.toml", "--out", "pendulum"],
    );
    assert!(message.contains("its `recipe."), "{message}");
    let after = std::fs::read(dir.join("pendulum/weights.safetensors")).unwrap();
    assert!(before == after);

    std::fs::create_dir(dir.join("full")).unwrap();
    std::fs::write(dir.join("full/thesis.txt"), "").unwrap();
    let message = refused(dir, &["train", "--config", &config, "--out", "full"]);
    assert!(message.contains("it holds other files"), "{message}");
}

#[test]
fn tuning_fits_a_simulated_prior_to_the_real_plant() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let offline = config("smoke/train-pendulum-offline.toml");
    json(dir, &["train", "--config", &offline, "--out", "sim"]);
    let config = config("smoke/tune-pendulum.toml");
    let command = [
        "tune",
        "--checkpoint",
        "sim",
        "--config",
        &config,
        "--out",
        "real",
    ];
    let outcome = json(dir, &command);
    let error = |when: &str| outcome["test_error"][when].as_f64().unwrap();
    assert!(error("after") < 0.5 * error("before"), "{outcome}");
    assert_eq!(json(dir, &command), outcome);
    // The prior is left as it is, and the result cannot overwrite it.
    let own = [
        "tune",
        "--checkpoint",
        "sim",
        "--config",
        &config,
        "--out",
        "sim",
    ];
    assert!(refused(dir, &own).contains("sim holds another run"));
}

#[test]
fn tuning_on_logs_needs_no_recipe() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let plant = config("plants/pendulum-real.toml");
    for (log, seed) in [("run1.csv", "1"), ("run2.csv", "2")] {
        json(
            dir,
            &["simulate", "--plant", &plant, "--out", log, "--seed", seed],
        );
    }
    let recipe = config("smoke/train-pendulum.toml");
    json(dir, &["train", "--config", &recipe, "--out", "prior"]);
    json(
        dir,
        &[
            "tune",
            "--checkpoint",
            "prior",
            "--train",
            "run1.csv",
            "--out",
            "tuned",
        ],
    );
    let error = |checkpoint: &str| {
        let evaluate = ["evaluate", "--checkpoint", checkpoint, "--test", "run2.csv"];
        json(dir, &[&evaluate[..], &["--horizon", "0.5"]].concat())["position_rmse"][0][0]
            .as_f64()
            .unwrap()
    };
    assert!(error("tuned") < error("prior"));

    let logs = "model = \"pendulum\"\nkind = \"hybrid\"\n[data]\nlogs = [\"run1.csv\"]\n\
                [fit]\nepochs = 20\nintegrator = \"rk4\"\n";
    std::fs::write(dir.join("logs.toml"), logs).unwrap();
    let outcome = json(dir, &["train", "--config", "logs.toml"]);
    assert_eq!(outcome["checkpoint"], "logs-checkpoint");
    assert!(outcome["error"]["after"].as_f64() < outcome["error"]["before"].as_f64());
}

#[test]
fn tuning_refuses_other_systems_start_values_and_missing_checkpoints() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let acrobot = config("smoke/train-acrobot.toml");
    json(dir, &["train", "--config", &acrobot, "--out", "acrobot"]);
    let pendulum = config("smoke/tune-pendulum.toml");
    for (checkpoint, config, part) in [
        (
            "acrobot",
            &pendulum,
            "its system is acrobot, the model's is pendulum",
        ),
        (
            "acrobot",
            &acrobot,
            "[start] and `hold` are for training from scratch",
        ),
        ("none", &pendulum, "not a checkpoint"),
    ] {
        let tune = ["tune", "--checkpoint", checkpoint, "--config", config];
        let message = refused(dir, &tune);
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn the_published_settings_recover_the_pendulum_parameters() {
    for backend in Backend::ALL {
        let outcome = train(recipe("train-pendulum.toml"), *backend);
        assert!(worst(&outcome) < 0.01, "{backend}: {outcome:?}");
    }
    let outcome = train(recipe("train-pendulum-adaptive.toml"), Backend::NdArray);
    assert!(worst(&outcome) < 0.01, "{outcome:?}");
    let outcome = train(recipe("train-pendulum-data-driven.toml"), Backend::NdArray);
    assert!(
        outcome.test_error.unwrap().after < 1e-3 * outcome.error.before,
        "{outcome:?}"
    );
}

/// Seed 0 of train-pendulum.toml; errors are means of ||s' - s_hat'||^2. The friction -0.5 qd has the norm
/// 0.5 * 8 / sqrt(3) = 2.3.
///
/// | alpha | C_g    | C_i   | prediction error | norm of F_r |
/// |-------|--------|-------|------------------|-------------|
/// | 0     | 14.979 | 2.813 | 1.0e-8           | 2.38        |
/// | 1e-5  | 14.987 | 3.001 | 7.0e-8           | 2.34        |
/// | 1e-4  | 14.996 | 3.000 | 6e-6             | 2.2         |
/// | 1e-3  | 14.999 | 3.000 | 6.3e-4           | 1.10        |
/// | 1e-2  | 15.000 | 3.000 | 2.2e-3           | 0.001       |
///
/// Without the penalty, the network takes over what the physics can express; with too large a penalty, the residual
/// vanishes and friction is not learnt.
#[test]
fn without_the_penalty_the_parameters_are_not_unique() {
    let with = |alpha| {
        let mut recipe = recipe("train-pendulum.toml");
        recipe.fit.penalty = Penalty::Fixed { alpha };
        train(recipe, Backend::NdArray)
    };
    assert!(worst(&with(0.0)) > 0.01);
    let (right, strong) = (with(1e-4), with(1e-2));
    assert!(worst(&right) < 0.001, "{right:?}");
    assert!(worst(&strong) < 0.001, "{strong:?}");
    assert!(right.error.after < 0.01 * strong.error.after);
}

#[test]
fn the_published_settings_recover_the_acrobot_parameters() {
    let outcome = train(recipe("train-acrobot.toml"), Backend::NdArray);
    assert!(worst(&outcome) < 0.01, "{outcome:?}");
    assert!(
        outcome.test_error.unwrap().after < 1e-3 * outcome.error.before,
        "{outcome:?}"
    );
}

mod slow {
    use super::*;

    #[test]
    fn a_killed_run_resumes_to_the_same_numbers() {
        let config = config("train-pendulum.toml");
        let (whole, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let command = [
            "train",
            "--config",
            &config,
            "--save-every",
            "20",
            "--out",
            "c",
        ];
        let expected = json(whole.path(), &command);

        let manifest = killed.path().join("c/checkpoint.json");
        for _ in 0..2 {
            let mut command = residyn(killed.path(), &command);
            kill_after(&mut command, &manifest, Duration::from_millis(120));
        }
        let output = run(killed.path(), &[command.as_slice(), &["--json"]].concat());
        let notes = String::from_utf8(output.stderr).unwrap();
        assert!(notes.contains("note: c resumes from epoch"), "{notes}");
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(found, expected);
        for file in [
            "weights.safetensors",
            "last.safetensors",
            "checkpoint.json",
            "model.toml",
        ] {
            let read = |dir: &Path| std::fs::read(dir.join("c").join(file)).unwrap();
            assert!(read(whole.path()) == read(killed.path()), "{file}");
        }
        let left = std::fs::read_dir(killed.path()).unwrap().count();
        assert_eq!(left, 1, "only the checkpoint is left");
    }
}
