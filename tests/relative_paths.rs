//! Configurations copied to another folder and used from a third: what they name is built in.

use std::fs;

use residyn_core::model::Library;
use residyn_experiments::experiment::{Config, Session};
use residyn_train::Backend;
use residyn_train::recipe::{Job, Recipe};

use crate::support::paths::configs;
use crate::support::{Scratch, text};

/// A folder with a copy of a configuration, `copy.toml`.
fn copy(configuration: &str) -> Scratch {
    let scratch = Scratch::new();
    fs::copy(configs().join(configuration), scratch.path("copy.toml")).unwrap();
    scratch
}

#[test]
fn commands_take_copies_of_configurations() {
    for (configuration, line) in [
        ("smoke/train-pendulum.toml", "train --config"),
        (
            "smoke/physics-prior-pendulum.toml",
            "experiment physics-prior --config",
        ),
        (
            "smoke/receding-horizon-pendulum.toml",
            "experiment receding-horizon --config",
        ),
        ("demo.toml", "simulate --plant"),
        ("plants/servo-real.toml", "simulate --plant"),
        (
            "tasks/pendulum.toml",
            "control --plant pendulum-real --model pendulum --task",
        ),
    ] {
        let (copy, empty) = (copy(configuration), Scratch::new());
        let [file, out] = ["copy.toml", "out"].map(|name| copy.path(name));
        let mut command = empty.command(line);
        let run = command.args([text(&file), "--out", text(&out)]).output();
        let run = run.unwrap();
        let errors = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{line}:\n{errors}");
        assert!(out.exists(), "{line} wrote nothing");
        assert_eq!(empty.count(), 0, "{line} left something where it was run");
    }
}

#[test]
fn all_recipes_and_experiments_name_what_is_built_in() {
    let library = Library::built_in();
    let named = |folder: &str| {
        let files = fs::read_dir(configs().join(folder)).unwrap();
        let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
        names
            .filter(|name| name.ends_with(".toml"))
            .map(|name| format!("{folder}/{name}"))
            .collect::<Vec<_>>()
    };
    let recipes: Vec<String> = named(".")
        .into_iter()
        .filter(|name| name.contains("train-"))
        .collect();
    assert!(recipes.len() >= 7, "{recipes:?}");
    for recipe in recipes {
        let recipe = Recipe::read(&copy(&recipe).path("copy.toml")).unwrap();
        Job::train(recipe, &library, Backend::default(), 0).unwrap();
    }
    // The recipes of `offline-prior` start from checkpoints, which are files of the project.
    let experiments = [named("physics-prior"), named("receding-horizon")].concat();
    assert!(experiments.len() >= 6, "{experiments:?}");
    for experiment in experiments {
        let config = Config::read(&copy(&experiment).path("copy.toml")).unwrap();
        Session::open(config, &library, Backend::default(), 0).unwrap();
    }
}
