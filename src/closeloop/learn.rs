use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use rand_chacha::ChaCha8Rng;

use super::study::{Fitted, Study};
use crate::data::{Log, half_width_s, local_cubic};
use crate::model::{
    Dynamics, HybridModel, Integrator, LastLayer, MlpSettings, MlpWeights, ResidualOn,
};
use crate::train::{Backend, FitSettings, LearningRates, Penalty, Segments, TrainError, Training};

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
    let Some((training, validation)) = segments(study) else {
        return Ok(None);
    };
    let mut dynamics = model.dynamics.clone();
    for (parameter, value) in dynamics.parameters.iter_mut().zip(&model.fit.values) {
        parameter.value = *value;
    }
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

/// Segments to train on and to choose the epoch by; `None` where the logs give too few.
fn segments(study: &Study<'_>) -> Option<(Segments, Segments)> {
    let stretches: Vec<Smooth> = study.logs.iter().flat_map(stretches).collect();
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

/// Smoothed states of a stretch of a log, rows put together to steps of about [`STEP_S`].
#[derive(Default)]
struct Smooth {
    time: Vec<f64>,
    /// `[row][2n]`
    states: Vec<f64>,
    /// `[row][n]`: the mean torque until the next row.
    inputs: Vec<f64>,
}

fn stretches(log: &Log) -> Vec<Smooth> {
    let step = log.median_step();
    let half_width = half_width_s(step);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small positive number
    let merged = ((STEP_S / step).round() as usize).max(1);
    let mut all = vec![Smooth::default()];
    for first in (0..log.rows().saturating_sub(merged)).step_by(merged) {
        let (from, to) = (log.time[first], log.time[first + merged]);
        let broken = to - from > 2.0 * step * merged as f64
            || log
                .leave_out
                .iter()
                .any(|span| span.start_s <= to && span.end_s >= from);
        let states: Option<Vec<_>> = log
            .q
            .iter()
            .map(|q| local_cubic(&log.time, q, first, half_width))
            .collect();
        let current = all.last_mut().expect("there is always one");
        let full = current
            .time
            .first()
            .is_some_and(|start| from - start >= STRETCH_S);
        match states {
            Some(states) if !broken => {
                current.time.push(from);
                current.states.extend(states.iter().map(|s| s.value));
                current.states.extend(states.iter().map(|s| s.slope));
                #[allow(clippy::cast_precision_loss)] // few rows
                let mean =
                    |tau: &Vec<f64>| tau[first..first + merged].iter().sum::<f64>() / merged as f64;
                current.inputs.extend(log.tau.iter().map(mean));
                if full {
                    all.push(Smooth::default());
                }
            }
            _ => all.push(Smooth::default()),
        }
    }
    all
}
