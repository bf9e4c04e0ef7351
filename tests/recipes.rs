//! The shipped recipes, and the errors for bad ones.

use residyn::read_model;
use residyn::read_plant;
use residyn_core::model::Library;
use residyn_train::recipe::{Job, Recipe};
use residyn_train::{Backend, Checkpoint};

use crate::support::paths::configs;
use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, replaced, says};

/// Recipes and plants; the demo's plant is part of the program, whose own tests read it.
#[test]
fn every_shipped_recipe_and_plant_can_be_read() {
    let (library, scratch) = (Library::built_in(), Scratch::new());
    let mut count = 0;
    for folder in ["", "plants", "smoke"] {
        let entries = std::fs::read_dir(configs().join(folder)).unwrap();
        for path in entries.map(|entry| entry.unwrap().path()) {
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            if folder == "plants" || name == "demo.toml" {
                read_plant(&path, &library).unwrap();
            } else if name.starts_with("train-") {
                // Read from another folder: what it names is built in.
                let copy = scratch.path(&name);
                std::fs::copy(&path, &copy).unwrap();
                let recipe = Recipe::read(&copy).unwrap();
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

/// Recipes that begin with TOP, some with all lines of PLANT, and words of their messages.
const BAD: &str = r#"
TOP alpha = 3\nPLANT                                 | line 3 ... unknown field `alpha`
TOP [start]\nC_q = 1.0\nPLANT                        | [start] names `C_q` ... did you mean `C_
TOP [data]\nlogs = ["gone.csv"]\n                    | gone.csv: cannot be read ... check the path
TOP [data]\nplant = "pendulum"\nlogs = ["a.csv"]\n   | line 3 ... both `logs` and `plant`
TOP [data]\nsteps = 1\n                              | neither `logs` (log files) nor `plant`
TOP PLANT\nsteps = 3\n                               | `steps` is 3 ... `length` of 1 steps
TOP PLANT\n[fit]\nlearning_rates = { physics = -1 }\n | it must be finite
"#;

/// A text of the recipe of TOP and PLANT, what stands there instead, and words of the message.
const CHANGED: &str = r#"
[[-1, 1]]                | [[1, -1]]            | `position` has the range
plant = "pendulum"       | plant = "acrobot"    | the plant's system is acrobot
model = "pendulum"       | model = "pendulun"   | pendulun ... give a model file or one of
"hybrid"\n               | "data_driven"\n[start]\nC_g = 1\n | remove them
"hybrid"\n               | "physics"\n[network]\nhidden = [4]\n | remove it
"#;

const TOP: &str = "model = \"pendulum\"\nkind = \"hybrid\"\n";
const PLANT: &str = "[data]\nplant = \"pendulum\"\ntrajectories = 4\nstep_s = 0.02\n\
    position = [[-1, 1]]\nvelocity = [[-1, 1]]\ntorque = [[-1, 1]]";

#[test]
fn bad_recipes_are_refused_with_place_and_remedy() {
    let scratch = Scratch::new();
    let bad = rows(BAD).into_iter().map(|[recipe, words]| {
        let recipe = recipe.replace("TOP ", TOP).replace("PLANT", PLANT);
        (recipe, words)
    });
    let changed = rows(CHANGED).into_iter().map(|[from, to, words]| {
        let recipe = replaced(&format!("{TOP}{PLANT}\n"), &from, &to);
        (recipe, words)
    });
    for (recipe, words) in bad.chain(changed) {
        scratch.file("bad.toml", recipe);
        says_words(&scratch.refuses("train --config bad.toml --out c"), &words);
    }
    let missing = scratch.refuses("train --config no.toml");
    says(&missing, &["no.toml: cannot be read"]);
    assert_eq!(scratch.count(), 1, "something is left behind");
}

/// Dry friction with another smoothing velocity is another model: the model file's value holds in training and tuning
/// as it does in evaluation.
#[test]
fn a_model_is_trained_and_tuned_with_its_own_smoothing_of_friction() {
    let scratch = Scratch::new();
    let pendulum = Library::system_text("pendulum").unwrap();
    let text = pendulum.replace("joints = 1", "joints = 1\nsmoothing_velocity = [0.3]")
        + "\n[[effect]]\nname = \"coulomb_friction\"\njoint = 1\nF_c = 0.2\n";
    scratch.file("model.toml", text);
    let top = "model = \"model.toml\"\nkind = \"physics\"\n";
    scratch.file("recipe.toml", format!("{top}{PLANT}\n[fit]\nepochs = 1\n"));
    let library = Library::built_in();
    let model = read_model(scratch.path("model.toml"), &library).unwrap();
    assert_eq!(model.smoothing_velocities(), [0.3]);
    let wanted = model.dynamics().program;
    let has_program = |job: Job| job.model.to_dynamics().unwrap().program == wanted;
    let recipe = Recipe::read(&scratch.path("recipe.toml")).unwrap();
    let job = Job::train(recipe.clone(), &library, Backend::NdArray, 0).unwrap();
    assert!(has_program(job), "training");
    scratch.succeeds("train --config recipe.toml --out trained");
    let checkpoint = Checkpoint::load(&scratch.path("trained")).unwrap();
    let job = Job::tune(&checkpoint, recipe, &library, Backend::NdArray, 0).unwrap();
    assert!(has_program(job), "tuning");
}
