//! Closing the loop for control: it recovers what an undeclared effect costs.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use residyn_core::model::Library;
use residyn_experiments::experiment::undeclared_effect::{Experiment, PlanningModel, Session};
use residyn_io::runs::RunFolder;
use residyn_plants::Reach;
use residyn_train::Backend;

use crate::support::Scratch;
use crate::support::paths::configs;
use crate::support::tables::rows;

fn session(path: &Path) -> Session {
    let experiment = Experiment::read(path).unwrap();
    Session::new(
        experiment,
        Library::built_in(),
        Backend::NdArray,
        0,
        Reach::Here,
    )
    .unwrap()
}

fn smoke() -> PathBuf {
    configs().join("smoke/undeclared-effect.toml")
}

#[test]
fn every_experiment_is_sound() {
    for name in ["pendulum", "acrobot"] {
        let path = configs().join(format!("undeclared-effect/{name}.toml"));
        assert!(session(&path).experiment.seeds >= 10);
    }
}

#[test]
fn friction_is_named_after_an_episode_and_the_return_recovered() {
    let dir = tempfile::tempdir().unwrap();
    let mut session = session(&smoke());
    let count = AtomicUsize::new(0);
    let folder = RunFolder::open(dir.path()).unwrap();
    let outcome = session
        .run(&folder, &|_| {
            count.fetch_add(1, Ordering::Relaxed);
        })
        .unwrap();
    assert_eq!(count.into_inner(), 1);
    let case = &outcome.cases[0];
    let found = &case.closed[0][0].effects;
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].name, "coulomb_friction");
    assert!((found[0].parameters[0].1 - 0.7).abs() < 0.05, "{found:?}");
    let won = |model: PlanningModel| {
        let mut models = case.models.iter().filter(|m| m.model == model);
        models.next().unwrap().won_back.unwrap().share
    };
    assert!(case.is_lost && case.loss > 50.0, "{}", case.loss);
    assert!(won(PlanningModel::Closed) > 0.9);
    assert!(outcome.reached);
    assert!(outcome.text().contains("coulomb_friction@1"));

    // Finished work is not repeated, and the results of another experiment are not mistaken for it.
    let kept = dir.path().join("runs/coulomb_friction-0.json");
    let written = std::fs::metadata(&kept).unwrap().modified().unwrap();
    assert_eq!(session.run(&folder, &|_| {}).unwrap(), outcome);
    assert_eq!(
        std::fs::metadata(&kept).unwrap().modified().unwrap(),
        written
    );
    session.experiment.fit.epochs += 1;
    let refused = session.run(&folder, &|_| {}).unwrap_err().to_string();
    assert!(refused.contains("holds another run: its `fit.epochs` is 20, here it is 21"));
}

/// A text of the experiment's file, what stands there instead, and words of the message.
const BAD: &str = r#"
episodes = [1]               | episodes = [3, 1]     | increasing numbers above zero
seeds = 1                    | seeds = 0             | at least one each
name = "coulomb_friction"\n  | name = "a/b"\n        | use letters
F_c = 0.7                    | F_d = 0.7             | has no parameter `F_d`; did you mean `F_c`
"pendulum-rig"               | "acrobot-rig"         | the task is for acrobot
seeds = 1                    | seed = 1              | unknown field `seed`
"#;

#[test]
fn bad_experiments_are_refused_with_their_remedy() {
    let scratch = Scratch::new();
    for [from, to, words] in rows(BAD) {
        let path = scratch.changed("smoke/undeclared-effect.toml", &from, &to);
        let read = Experiment::read(path.as_ref());
        let session = read
            .and_then(|e| Session::new(e, Library::built_in(), Backend::NdArray, 0, Reach::Here));
        let found = session.err().unwrap().to_string();
        assert!(found.contains(&words), "{found}");
        assert!(found.starts_with(&path), "{found}");
    }
}
