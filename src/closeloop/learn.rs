use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use rand_chacha::ChaCha8Rng;

use super::study::{Fitted, Study, joined};
use crate::data::{Log, Thinning, Trajectory, trajectories};
use crate::model::{
    Dynamics, Integrator, LastLayer, MlpSettings, MlpWeights, ResidualOn, absorbed, as_modelled,
};
use crate::train::{
    Backend, FitSettings, HybridModel, LearningRates, Penalty, Segments, TrainError, Training,
};

/// Rows nearer than this (s) are put together: the network is to learn a force, not the encoder's noise.
const STEP_S: f64 = 0.01;
/// Steps that a segment unrolls.
const STEPS: usize = 8;
/// About as many segments are enough for a network of some hundred weights.
const SEGMENTS: usize = 1200;
/// One stretch of this length (s) in every [`EVERY`] is kept to choose the epoch.
const STRETCH_S: f64 = 2.0;
const EVERY: usize = 5;
const EPOCHS: usize = 250;
/// The penalty on the network's size: it takes over only what pays for it.
const ALPHA: f64 = 1e-3;

/// A run that trained the residual network, for its checkpoint, and the hybrid that came of it.
pub struct Learned {
    pub training: Training,
    pub hybrid: Dynamics,
}

/// Train the residual MLP on what the fitted model leaves, with the physics held, and return the hybrid of the
/// epoch that predicts stretches best that it was not trained on; the untrained one is among them.
pub fn learn_residual(
    study: &Study<'_>,
    model: &Fitted,
    backend: Backend,
    rng: &mut ChaCha8Rng,
    progress: &mut dyn FnMut(&str),
) -> Result<Option<Learned>, TrainError> {
    let Some((training, validation)) = segments(study, model) else {
        return Ok(None);
    };
    // The checkpoint's own model file has shifted parameters in their places, and so must what is trained.
    let (declared, effects) = absorbed(&model.declared, &model.effects);
    let dynamics = (study.system.dynamics_with(&effects, &study.sign))
        .with_values(joined(&declared, &effects));
    let settings = MlpSettings {
        hidden: study.system.hidden.clone(),
        on: ResidualOn::Accelerations,
        ..MlpSettings::for_joints(study.system.joints)
    };
    let scaling = training.scaling(settings.angles);
    let weights = MlpWeights::new(
        study.system.joints,
        &settings,
        scaling,
        LastLayer::Zero,
        rng,
    );
    let hybrid = HybridModel::physics(&dynamics, &backend.device())?.with_residual(&weights)?;
    let mut run = Training::new(hybrid, fit_settings(), rng.clone())?;
    run.run(&training, Some(&validation), &mut |at| {
        progress(&format!(
            "training the residual network, epoch {} of {}",
            at.epoch, at.epochs
        ));
        ControlFlow::Continue(())
    })?;
    let hybrid = run.result()?.to_dynamics()?;
    Ok(Some(Learned {
        training: run,
        hybrid,
    }))
}

fn fit_settings() -> FitSettings {
    FitSettings {
        epochs: EPOCHS,
        learning_rates: LearningRates {
            physics: 0.0,
            residual: 0.003,
            ..LearningRates::default()
        },
        penalty: Penalty::Fixed { alpha: ALPHA },
        integrator: Integrator::Rk4,
        record_every: NonZeroUsize::new(10).expect("not zero"),
        ..FitSettings::default()
    }
}

/// Segments to train on and to choose the epoch by; `None` where the logs give too few. The network sees what
/// the model does.
fn segments(study: &Study<'_>, model: &Fitted) -> Option<(Segments, Segments)> {
    let thinning = Thinning {
        step_s: STEP_S,
        length_s: STRETCH_S,
    };
    let of_log = |(k, log): (usize, &Log)| {
        let values = model.fit.values_of_log(k);
        trajectories(&as_modelled(&model.dynamics, &values, log), thinning)
    };
    let logs = study.logs.iter().enumerate();
    let stretches: Vec<Trajectory> = logs.flat_map(of_log).collect();
    let rows: usize = stretches.iter().map(|s| s.time.len()).sum();
    let stride = (rows / SEGMENTS).max(1);
    let mut sets = [
        Segments::new(study.system.joints, STEPS),
        Segments::new(study.system.joints, STEPS),
    ];
    for (index, stretch) in stretches.iter().enumerate() {
        let set = &mut sets[usize::from(index % EVERY == EVERY - 1)];
        // A stretch that is too short holds no segment; that is no error here.
        let _ = set.push_trajectory(&stretch.time, &stretch.states, &stretch.inputs, stride);
    }
    let [training, validation] = sets;
    (!training.is_empty() && !validation.is_empty()).then_some((training, validation))
}
