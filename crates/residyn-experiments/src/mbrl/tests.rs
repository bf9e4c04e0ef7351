use std::fs;
use std::path::Path;

use rayon::prelude::*;
use serde_json::json;

use super::{Folder, Learner, Prior, Round, Run, RunState, Schedule, transitions};
use residyn_control::control::Task;
use residyn_core::data::Joint;
use residyn_core::model::{Angles, Dynamics, Library, MlpSettings, Origin};
use residyn_core::plant::Noise;
use residyn_io::read_plant;
use residyn_io::runs::RunFolder;
use residyn_plants::Controlled;
use residyn_train::{Backend, FitSettings, Penalty};

fn folder(dir: &Path) -> Folder {
    Folder::open(RunFolder::open(dir).unwrap()).unwrap()
}

struct Setting {
    task: Task,
    plant: Controlled,
    declaration: String,
    learner: Learner,
    dynamics: Dynamics,
}

/// The pendulum with friction, noise and a delay, which is an effect with memory.
fn setting() -> Setting {
    let library = Library::built_in();
    let mut task = Task::read(Path::new("pendulum")).unwrap();
    task.steps = 60;
    task.replan = 10;
    task.planner.horizon = 20;
    task.planner.iterations = 2;
    task.start_spread = vec![0.2, 0.1];
    task.plant.noise = Noise {
        position: 1e-3,
        velocity: 1e-2,
    };
    let mut plant = read_plant(Path::new("pendulum-real"), &library).unwrap();
    plant
        .add_effect(
            &library,
            "actuator_delay",
            Joint::at(0),
            &[("d".to_owned(), 0.03)],
        )
        .unwrap();
    let dynamics = plant.system.dynamics();
    let declaration = plant.system.declaration.clone();
    let network = MlpSettings {
        hidden: vec![4],
        angles: Angles::SinCos,
        ..MlpSettings::for_joints(1)
    };
    let fit = FitSettings {
        epochs: 20,
        penalty: Penalty::Fixed { alpha: 1e-6 },
        ..FitSettings::default()
    };
    let learner = Learner {
        system: "pendulum".to_owned(),
        joints: 1,
        prior: Prior::Equations(Box::new(dynamics.clone())),
        network,
        fit,
        backend: Backend::NdArray,
    };
    Setting {
        task,
        plant: plant.into(),
        declaration,
        learner,
        dynamics,
    }
}

impl Setting {
    fn run(&self, folder: &Path) -> Run<'_> {
        Run {
            task: &self.task,
            plant: &self.plant,
            learner: &self.learner,
            schedule: Schedule {
                random: 15,
                gather: 20,
                rounds: 5,
            },
            seed: 4,
            folder: folder.to_owned(),
        }
    }

    fn rounds(&self, run: &Run<'_>, state: &mut RunState, folder: &mut Folder, until: usize) {
        let origin = Origin {
            config: json!({}),
            model_toml: self.declaration.clone(),
            ..Origin::of_seed(4)
        };
        while state.rounds < until {
            let (round, training) = run.round(state).unwrap();
            folder.keep(round, state, &training, &origin).unwrap();
        }
    }

    fn in_sessions(&self, ends: &[usize]) -> (Vec<Round>, Vec<f64>) {
        let dir = tempfile::tempdir().unwrap();
        let run = self.run(dir.path());
        for end in ends {
            let mut folder = folder(dir.path());
            let mut state = folder.state(&run, &self.dynamics).unwrap();
            self.rounds(&run, &mut state, &mut folder, *end);
        }
        let folder = folder(dir.path());
        let state = folder.state(&run, &self.dynamics).unwrap();
        let logs = state.logs;
        (
            folder.rounds().to_vec(),
            logs.into_iter().flat_map(|log| log.q[0].clone()).collect(),
        )
    }
}

#[test]
fn an_interrupted_run_equals_an_uninterrupted_one() {
    let setting = setting();
    let (rounds, angles) = setting.in_sessions(&[5]);
    // The run is interrupted within an episode of three stretches and at its end.
    assert_eq!(
        setting.in_sessions(&[1, 3, 5]),
        (rounds.clone(), angles.clone())
    );
    let seen: Vec<usize> = rounds.iter().map(|round| round.transitions).collect();
    assert_eq!(seen, [15, 35, 55, 75, 95]);
    assert_eq!(angles.len(), 15 + 5 * 20 + 6);
}

#[test]
fn a_round_that_was_not_recorded_is_repeated_from_the_previous_model() {
    let setting = setting();
    let (killed, further) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let go_on = |dir: &Path, until| {
        let mut folder = folder(dir);
        let run = setting.run(dir);
        let mut state = folder.state(&run, &setting.dynamics).unwrap();
        setting.rounds(&run, &mut state, &mut folder, until);
        folder
    };
    // The state after a kill between writing the third model and writing its line.
    let second = go_on(killed.path(), 2).checkpoint();
    let third = go_on(further.path(), 3).checkpoint();
    let left = killed.path().join(third.file_name().unwrap());
    fs::rename(third, &left).unwrap();
    assert_eq!(
        go_on(killed.path(), 5).rounds(),
        setting.in_sessions(&[5]).0
    );
    assert!(!second.exists() && !left.exists());
}

#[test]
fn a_stretch_begins_where_the_last_one_ended() {
    let mut setting = setting();
    setting.task.plant.noise = Noise::default();
    let (_, angles) = setting.in_sessions(&[5]);
    let stretch = |k: usize| &angles[16 + 21 * k..][..21];
    assert_eq!(stretch(0)[20], stretch(1)[0]);
    assert_eq!(stretch(1)[20], stretch(2)[0]);
    // An episode has three stretches; the next one has a new initial state.
    assert_ne!(stretch(2)[20], stretch(3)[0]);
    assert!((stretch(3)[0] - std::f64::consts::PI).abs() < 0.2);
}

#[test]
fn runs_of_one_trained_prior_do_not_block_each_other() {
    let mut setting = setting();
    let begun = setting.run(Path::new("")).begin().unwrap();
    let segments = transitions(&begun.logs, 1).unwrap();
    let trained = setting.learner.learn(&segments, None, 0, 0).unwrap();
    setting.learner.prior = Prior::Trained(Box::new(trained.result().unwrap()));
    setting.learner.fit.epochs = 500;
    let learn = |seed| {
        setting
            .learner
            .learn(&segments, None, seed, 0)
            .unwrap()
            .epoch()
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(4)
        .build()
        .unwrap();
    let epochs: Vec<usize> = pool.install(|| (0..8).into_par_iter().map(learn).collect());
    assert_eq!(epochs, [500; 8]);
}
