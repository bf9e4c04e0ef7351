//! The shipped recipes, and the errors for bad ones.

use residyn::read_model;
use residyn::read_plant;
use residyn_core::model::Library;
use residyn_train::recipe::{Job, Recipe};
use residyn_train::{Backend, Checkpoint};

use crate::support::in_folder::{json, refused};
use crate::support::paths::configs;

/// Recipes and plants; the demo's plant is part of the program, whose own tests read it.
#[test]
fn every_shipped_recipe_and_plant_can_be_read() {
    let library = Library::built_in();
    let mut count = 0;
    for folder in ["", "plants", "smoke"] {
        let entries = std::fs::read_dir(configs().join(folder)).unwrap();
        for path in entries.map(|entry| entry.unwrap().path()) {
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            if folder == "plants" || name == "demo.toml" {
                read_plant(&path, &library).unwrap();
            } else if name.starts_with("train-") {
                let recipe = Recipe::read(&path).unwrap();
                Job::train(recipe, &library, Backend::NdArray, 0)
                    .map(drop)
                    .unwrap();
            } else if name.starts_with("tune-") {
                Recipe::read(&path).unwrap();
            } else {
                continue;
            }
            count += 1;
        }
    }
    assert!(count >= 14, "{count}");
}

#[test]
fn bad_recipes_are_refused_with_place_and_remedy() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let top = "model = \"pendulum\"\nkind = \"hybrid\"\n";
    let plant = "[data]\nplant = \"pendulum\"\ntrajectories = 4\nstep_s = 0.02\nposition = [[-1, 1]]\n\
                 velocity = [[-1, 1]]\ntorque = [[-1, 1]]\n";
    let two = "[data]\nplant = \"pendulum\"\nlogs = [\"a.csv\"]\n";
    let cases: &[(String, &[&str])] = &[
        (
            format!("{top}alpha = 3\n{plant}"),
            &["line 3", "unknown field `alpha`"],
        ),
        (
            format!("{top}[start]\nC_q = 1.0\n{plant}"),
            &["[start] names `C_q`", "did you mean `C_"],
        ),
        (
            format!("{top}[data]\nlogs = [\"gone.csv\"]\n"),
            &["gone.csv: cannot be read", "check the path"],
        ),
        (
            format!("{top}{two}"),
            &["line 3", "both `logs` and `plant`"],
        ),
        (
            format!("{top}[data]\nsteps = 1\n"),
            &["neither `logs` (log files) nor `plant`"],
        ),
        (
            format!("{top}{plant}steps = 3\n"),
            &["`steps` is 3", "`length` of 1 steps"],
        ),
        (
            top.to_owned() + &plant.replace("[[-1, 1]]", "[[1, -1]]"),
            &["`position` has the range"],
        ),
        (
            top.to_owned() + &plant.replace("\"pendulum\"", "\"acrobot\""),
            &["the plant's system is acrobot"],
        ),
        (
            top.replace("pendulum", "pendulun") + plant,
            &["pendulun", "give a model file or one of"],
        ),
        (
            top.replace("hybrid", "data_driven") + "[start]\nC_g = 1\n" + plant,
            &["remove them"],
        ),
        (
            top.replace("hybrid", "physics") + plant + "[network]\nhidden = [4]\n",
            &["remove it"],
        ),
        (
            format!("{top}{plant}[fit]\nlearning_rates = {{ physics = -1 }}\n"),
            &["it must be finite"],
        ),
    ];
    for (text, wanted) in cases {
        std::fs::write(dir.join("bad.toml"), text).unwrap();
        let message = refused(dir, &["train", "--config", "bad.toml", "--out", "c"]);
        for part in *wanted {
            assert!(message.contains(part), "{part:?} in {message}");
        }
    }
    assert!(refused(dir, &["train", "--config", "no.toml"]).contains("no.toml: cannot be read"));
    let left: Vec<_> = std::fs::read_dir(dir).unwrap().collect();
    assert_eq!(left.len(), 1, "nothing is left behind: {left:?}");
}

/// Dry friction with another smoothing velocity is another model: the model file's value holds in training and tuning
/// as it does in evaluation.
#[test]
fn a_model_is_trained_and_tuned_with_its_own_smoothing_of_friction() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let pendulum = Library::system_text("pendulum").unwrap();
    let text = pendulum.replace("joints = 1", "joints = 1\nsmoothing_velocity = [0.3]")
        + "\n[[effect]]\nname = \"coulomb_friction\"\njoint = 1\nF_c = 0.2\n";
    std::fs::write(dir.join("model.toml"), text).unwrap();
    let recipe = "model = \"model.toml\"\nkind = \"physics\"\n[data]\nplant = \"pendulum\"\ntrajectories = 4\n\
                  step_s = 0.02\nposition = [[-1, 1]]\nvelocity = [[-1, 1]]\ntorque = [[-1, 1]]\n[fit]\nepochs = 1\n";
    std::fs::write(dir.join("recipe.toml"), recipe).unwrap();
    let library = Library::built_in();
    let model = read_model(dir.join("model.toml"), &library).unwrap();
    assert_eq!(model.smoothing_velocities(), [0.3]);
    let wanted = model.dynamics().program;
    let has_program = |job: Job| job.model.to_dynamics().unwrap().program == wanted;
    let recipe = Recipe::read(&dir.join("recipe.toml")).unwrap();
    let job = Job::train(recipe.clone(), &library, Backend::NdArray, 0).unwrap();
    assert!(has_program(job), "training");
    json(
        dir,
        &["train", "--config", "recipe.toml", "--out", "trained"],
    );
    let checkpoint = Checkpoint::load(&dir.join("trained")).unwrap();
    let job = Job::tune(&checkpoint, recipe, &library, Backend::NdArray, 0).unwrap();
    assert!(has_program(job), "tuning");
}
