//! Stage 8: train a small network on what the refined model leaves.

use std::ops::ControlFlow;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use super::fitted::Fitted;
use super::per_log::joined;
use super::refine::Refined;
use super::settings::LearnSettings;
use super::stage::{Progress, Stage};
use super::study::Study;
use crate::data::{Log, Thinning, Trajectory, trajectories};
use crate::model::{
    Dynamics, HybridError, HybridModel, LastLayer, MlpSettings, MlpWeights, ResidualOn, absorbed,
};
use crate::sim::{Integrator, Point, as_modelled};
use crate::train::{Backend, FitSettings, LearningRates, Penalty, Segments, TrainError, Training};

/// A run that trained the residual network, for its checkpoint, and the hybrid that came of it.
pub struct Learned {
    pub training: Training,
    pub hybrid: Dynamics,
}

/// Why the residual network could not be trained.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LearnError {
    #[error(transparent)]
    Train(#[from] TrainError),
    #[error(transparent)]
    Hybrid(#[from] HybridError),
}

/// Train the residual network on what the refined model leaves, with the physics held, and return the hybrid of the
/// epoch that predicts best the stretches that it was not trained on; the untrained one is among them. `None` where
/// no network is asked for or the logs are too few to train it.
pub(super) fn learn(
    refined: &Refined<'_>,
    backend: Option<Backend>,
    rng: &mut impl Rng,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Option<Learned>, LearnError> {
    let Refined { study, model, .. } = refined;
    let Some(backend) = backend else {
        return Ok(None);
    };
    let Some((training, validation)) = segments(study, model) else {
        return Ok(None);
    };
    let hybrid = untrained(study, model, &training, backend, rng)?;
    // Training takes numbers from a stream of its own, which its checkpoint carries on.
    let mut run = Training::new(
        hybrid,
        fit_settings(&study.settings.learn),
        ChaCha8Rng::from_rng(rng),
    )?;
    run.run(&training, Some(&validation), &mut |at| {
        let text = format!(
            "{}, epoch {} of {}",
            Stage::Learn.text(),
            at.epoch,
            at.epochs
        );
        progress(Progress::within(Stage::Learn, &text));
        ControlFlow::Continue(())
    })?;
    Ok(Some(Learned {
        hybrid: run.result()?.to_dynamics()?,
        training: run,
    }))
}

/// The model with a network that adds nothing yet.
fn untrained(
    study: &Study<'_>,
    model: &Fitted,
    training: &Segments,
    backend: Backend,
    rng: &mut impl Rng,
) -> Result<HybridModel, LearnError> {
    // The checkpoint's own model file has shifted parameters in their places, and so must what is trained.
    let (declared, effects) = absorbed(&model.declared, &model.effects);
    let dynamics = (study.system.dynamics_with(&effects, &study.sign))
        .with_values(joined(&declared, &effects));
    let joints = study.system.joints;
    let settings = MlpSettings {
        hidden: study.system.hidden.clone(),
        on: ResidualOn::Accelerations,
        ..MlpSettings::for_joints(joints)
    };
    let scaling = training.scaling(settings.angles);
    let weights = MlpWeights::new(joints, &settings, scaling, LastLayer::Zero, rng);
    Ok(HybridModel::physics(&dynamics, &backend.device())?.with_residual(&weights)?)
}

fn fit_settings(settings: &LearnSettings) -> FitSettings {
    FitSettings {
        epochs: settings.epochs,
        learning_rates: LearningRates {
            physics: 0.0,
            residual: settings.learning_rate,
            ..LearningRates::default()
        },
        penalty: Penalty::Fixed {
            alpha: settings.alpha,
        },
        integrator: Integrator::RK4,
        record_every: settings.record_every,
        ..FitSettings::default()
    }
}

/// Segments to train on and to choose the epoch by; `None` where the logs give too few. The network's inputs are the
/// model's own angles and torques.
fn segments(study: &Study<'_>, model: &Fitted) -> Option<(Segments, Segments)> {
    let settings = &study.settings.learn;
    let thinning = Thinning {
        step_s: settings.step_s,
        length_s: settings.stretch_s,
    };
    let of_log = |(k, log): (usize, &Log)| {
        let point = Point::new(&model.dynamics, model.fit.values_of_log(k));
        trajectories(&as_modelled(&point, log), thinning)
    };
    let logs = study.logs.iter().enumerate();
    let stretches: Vec<Trajectory> = logs.flat_map(of_log).collect();
    let rows: usize = stretches.iter().map(|s| s.time.len()).sum();
    let stride = (rows / settings.segments).max(1);
    let mut sets = [
        Segments::new(study.system.joints, settings.steps),
        Segments::new(study.system.joints, settings.steps),
    ];
    for (index, stretch) in stretches.iter().enumerate() {
        let set = &mut sets[usize::from(index % settings.every == settings.every - 1)];
        // A stretch too short for a segment is skipped.
        let _ = set.push_trajectory(&stretch.time, &stretch.states, &stretch.inputs, stride);
    }
    let [training, validation] = sets;
    (!training.is_empty() && !validation.is_empty()).then_some((training, validation))
}
