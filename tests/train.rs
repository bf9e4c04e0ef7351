//! `residyn train` and `residyn tune`, through the binary if the command line matters.

use std::ops::ControlFlow;
use std::time::Duration;

use residyn_core::model::Library;
use residyn_io::runs::RunFolder;
use residyn_train::recipe::{Job, Recipe, TrainingResults};
use residyn_train::{Backend, Penalty};
use serde_json::Value;

use crate::support::in_folder::kill_after;
use crate::support::paths::configs;
use crate::support::{Scratch, says};

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

/// Short recipes for training and for tuning.
const SHORT: &str = "--config $REPO/configs/smoke/train-pendulum.toml";
const TUNING: &str = "--config $REPO/configs/smoke/tune-pendulum.toml";

#[test]
fn a_checkpoint_of_another_run_is_not_overwritten() {
    let scratch = Scratch::new();
    let train = format!("train {SHORT} --out pendulum");
    let first = scratch.json(&train);
    // The same command again returns at once, although the folder now has the name of a built-in system.
    assert_eq!(scratch.json(&train), first);
    let weights = || std::fs::read(scratch.path("pendulum/weights.safetensors")).unwrap();
    let before = weights();
    assert_eq!(
        scratch.refuses(&format!("{train} --seed 7")),
        "error: pendulum holds another run: its `seed` is 0, here it is 7; give another \
         folder with --out, or remove this one to start over\n"
    );
    scratch.changed("smoke/train-pendulum.toml", "epochs = 200", "epochs = 300");
    let longer = scratch.refuses("train --config train-pendulum.toml --out pendulum");
    says(&longer, &["its `recipe."]);
    assert!(before == weights());

    std::fs::create_dir(scratch.path("full")).unwrap();
    scratch.file("full/thesis.txt", "");
    let full = scratch.refuses(&format!("train {SHORT} --out full"));
    says(&full, &["it holds other files"]);
}

#[test]
fn tuning_fits_a_simulated_prior_to_the_real_plant() {
    let scratch = Scratch::new();
    scratch.succeeds("train --config $REPO/configs/smoke/train-pendulum-offline.toml --out sim");
    let tune = format!("tune --checkpoint sim {TUNING} --out");
    let outcome = scratch.json(&format!("{tune} real"));
    let error = |when: &str| outcome["test_error"][when].as_f64().unwrap();
    assert!(error("after") < 0.5 * error("before"), "{outcome}");
    assert_eq!(scratch.json(&format!("{tune} real")), outcome);
    // The prior is left as it is, and the result cannot overwrite it.
    let own = scratch.refuses(&format!("{tune} sim"));
    says(&own, &["sim holds another run"]);
}

#[test]
fn tuning_on_logs_needs_no_recipe() {
    let scratch = Scratch::new();
    scratch.simulates("pendulum-real", &[1, 2]);
    scratch.succeeds(&format!("train {SHORT} --out prior"));
    scratch.succeeds("tune --checkpoint prior --train run1.csv --out tuned");
    let error =
        |checkpoint: &str| scratch.evaluated(&format!("--checkpoint {checkpoint} --test run2.csv"));
    assert!(error("tuned") < error("prior"));

    let logs = "model = \"pendulum\"\nkind = \"hybrid\"\n[data]\nlogs = [\"run1.csv\"]\n\
                [fit]\nepochs = 20\nintegrator = \"rk4\"\n";
    scratch.file("logs.toml", logs);
    let outcome = scratch.json("train --config logs.toml");
    assert_eq!(outcome["checkpoint"], "logs-checkpoint");
    assert!(outcome["error"]["after"].as_f64() < outcome["error"]["before"].as_f64());
}

#[test]
fn tuning_refuses_other_systems_start_values_and_missing_checkpoints() {
    let scratch = Scratch::new();
    let acrobot = "--config $REPO/configs/smoke/train-acrobot.toml";
    scratch.succeeds(&format!("train {acrobot} --out acrobot"));
    for (checkpoint, config, part) in [
        (
            "acrobot",
            TUNING,
            "its system is acrobot, the model's is pendulum",
        ),
        (
            "acrobot",
            acrobot,
            "[start] and `hold` are for training from scratch",
        ),
        ("none", TUNING, "not a checkpoint"),
    ] {
        let message = scratch.refuses(&format!("tune --checkpoint {checkpoint} {config}"));
        says(&message, &[part]);
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
        let [whole, killed] = [(); 2].map(|()| Scratch::new());
        let line = "train --config $REPO/configs/train-pendulum.toml --save-every 20 --out c";
        let expected = whole.json(line);
        for _ in 0..2 {
            let manifest = killed.path("c/checkpoint.json");
            kill_after(
                &mut killed.command(line),
                &manifest,
                Duration::from_millis(120),
            );
        }
        let output = killed.run(&format!("{line} --json"));
        let notes = String::from_utf8(output.stderr).unwrap();
        says(&notes, &["note: c resumes from epoch"]);
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(found, expected);
        for file in [
            "weights.safetensors",
            "last.safetensors",
            "checkpoint.json",
            "model.toml",
        ] {
            let read = |scratch: &Scratch| std::fs::read(scratch.path("c").join(file)).unwrap();
            assert!(read(&whole) == read(&killed), "{file}");
        }
        assert_eq!(killed.count(), 1, "only the checkpoint is left");
    }
}
