//! Configurations copied to another folder and used from a third: what they name is built in.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use residyn_core::model::Library;
use residyn_experiments::experiment::{Config, Session};
use residyn_train::Backend;
use residyn_train::recipe::{Job, Recipe};

use crate::support::text;

/// A copy of a configuration in an otherwise empty folder.
struct Copy {
    folder: tempfile::TempDir,
    file: PathBuf,
}

fn copy(configuration: &str) -> Copy {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("copy.toml");
    fs::copy(configs.join(configuration), &file).unwrap();
    Copy { folder, file }
}

impl Copy {
    /// Run the program in an empty folder; its output goes next to the copy.
    fn runs(&self, command: &[&str], more: &[&str]) {
        let empty = tempfile::tempdir().unwrap();
        let out = self.folder.path().join("out");
        let output = Command::new(env!("CARGO_BIN_EXE_residyn"))
            .current_dir(empty.path())
            .args([command, &[text(&self.file), "--out", text(&out)], more].concat())
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{command:?}:\n{errors}");
        assert!(out.exists(), "{command:?} wrote nothing");
        let left = fs::read_dir(empty.path()).unwrap().count();
        assert_eq!(left, 0, "{command:?} left something where it was run");
    }
}

#[test]
fn commands_take_copies_of_configurations() {
    copy("smoke/train-pendulum.toml").runs(&["train", "--config"], &[]);
    let experiments = ["physics-prior", "receding-horizon"];
    for name in experiments {
        let file = format!("smoke/{name}-pendulum.toml");
        copy(&file).runs(&["experiment", name, "--config"], &[]);
    }
    for plant in ["demo.toml", "plants/servo-real.toml"] {
        copy(plant).runs(&["simulate", "--plant"], &[]);
    }
    let control = [
        "control",
        "--plant",
        "pendulum-real",
        "--model",
        "pendulum",
        "--task",
    ];
    copy("tasks/pendulum.toml").runs(&control, &[]);
}

#[test]
fn all_recipes_and_experiments_name_what_is_built_in() {
    let library = Library::built_in();
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let named = |folder: &str| {
        let files = fs::read_dir(configs.join(folder)).unwrap();
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
        let recipe = Recipe::read(&copy(&recipe).file).unwrap();
        Job::train(recipe, &library, Backend::default(), 0).unwrap();
    }
    // The recipes of `offline-prior` start from checkpoints, which are files of the project.
    let experiments = [named("physics-prior"), named("receding-horizon")].concat();
    assert!(experiments.len() >= 6, "{experiments:?}");
    for experiment in experiments {
        let config = Config::read(&copy(&experiment).file).unwrap();
        Session::open(config, &library, Backend::default(), 0).unwrap();
    }
}
