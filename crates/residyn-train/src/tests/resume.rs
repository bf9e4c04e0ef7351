use std::ops::ControlFlow;
use std::path::Path;

use super::{hybrid, pendulum, rng, transitions};
use crate::{Backend, Batching, Checkpoint, Ended, FitSettings, Penalty, Training, save};
use residyn_core::model::{LastLayer, Origin};

fn origin() -> Origin {
    Origin {
        config: serde_json::json!({"learning_rate": 0.1}),
        model_toml: "[system]\n".to_owned(),
        ..Origin::of_seed(3)
    }
}

fn training(backend: Backend) -> Training {
    let settings = FitSettings {
        epochs: 60,
        batching: Batching::Mini {
            size: 32.try_into().unwrap(),
        },
        penalty: Penalty::Adaptive {
            initial: 10.0,
            rate: 0.7,
        },
        record_every: 10.try_into().unwrap(),
        ..FitSettings::default()
    };
    let model = hybrid(
        (8.0, 2.0),
        &transitions(100, -0.5, 1),
        backend,
        LastLayer::Zero,
    );
    Training::new(model, settings, rng(3)).unwrap()
}

/// Continue until `epoch`, saving there if a directory is given.
fn run(training: &mut Training, epoch: usize, dir: Option<&Path>) -> Ended {
    let (segments, validation) = (transitions(100, -0.5, 1), transitions(30, -0.5, 2));
    let mut observer = |progress: &crate::Progress| {
        if progress.epoch < epoch {
            return ControlFlow::Continue(());
        }
        if let Some(dir) = dir {
            save(dir, progress.training, &origin()).unwrap();
        }
        ControlFlow::Break(())
    };
    training
        .run(&segments, Some(&validation), &mut observer)
        .unwrap()
}

#[test]
fn a_resumed_run_equals_an_uninterrupted_one_bit_for_bit() {
    for backend in Backend::ALL {
        let mut whole = training(*backend);
        assert_eq!(run(&mut whole, usize::MAX, None), Ended::Finished);

        let dir = tempfile::tempdir().unwrap();
        let dir = dir.path().join("checkpoint");
        assert_eq!(run(&mut training(*backend), 25, Some(&dir)), Ended::Stopped);
        let checkpoint = Checkpoint::load(&dir).unwrap();
        let mut resumed = checkpoint
            .training(&pendulum(1.0, 1.0), &backend.device())
            .unwrap();
        assert_eq!(resumed.epoch(), 25);
        assert_eq!(run(&mut resumed, usize::MAX, None), Ended::Finished);

        assert_eq!(resumed.model().weights(), whole.model().weights());
        assert_eq!(resumed.history(), whole.history());
        assert_eq!(resumed.best, whole.best);
        assert_eq!(resumed.rng, whole.rng);
        assert_eq!(
            resumed.penalty_weight.to_bits(),
            whole.penalty_weight.to_bits()
        );
        assert_eq!(whole.history().len(), 7);
    }
}
