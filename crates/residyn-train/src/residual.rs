use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

use rand::Rng;

use super::{
    Backend, CheckpointError, FitSettings, HybridModel, LearningRates, Penalty, Segments,
    TrainError, Training, save,
};
use residyn_core::closeloop::{
    LearnError, LearnSettings, LearnedResidual, ResidualLearner, ResidualTask,
};
use residyn_core::data::Trajectory;
use residyn_core::model::{Dynamics, LastLayer, MlpSettings, Origin, ResidualOn};
use residyn_core::sim::Integrator;

/// Trains the residual network of closing the loop.
#[derive(Debug, Clone, Copy, Default)]
pub struct ResidualTrainer {
    pub backend: Backend,
}

/// A run that trained a residual network, and the resulting hybrid model.
struct TrainedResidual {
    run: Training,
    hybrid: Dynamics,
}

impl ResidualLearner for ResidualTrainer {
    fn learn(
        &self,
        task: &ResidualTask,
        rng: &mut dyn Rng,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Box<dyn LearnedResidual>>, LearnError> {
        let trained = self.train(task, rng, progress).map_err(LearnError::new)?;
        Ok(trained.map(|trained| Box::new(trained) as Box<dyn LearnedResidual>))
    }
}

impl LearnedResidual for TrainedResidual {
    fn hybrid(&self) -> &Dynamics {
        &self.hybrid
    }

    fn save(&self, folder: &Path, origin: &Origin) -> Result<(), Box<dyn Error + Send + Sync>> {
        save(folder, &self.run, origin).map_err(|error| match error {
            CheckpointError::Output(error) => error.into(),
            other => other.into(),
        })
    }
}

impl ResidualTrainer {
    fn train(
        self,
        task: &ResidualTask,
        mut rng: &mut dyn Rng,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<TrainedResidual>, TrainError> {
        let [training, validation] = segments(task);
        if training.is_empty() || validation.is_empty() {
            return Ok(None);
        }
        let settings = MlpSettings {
            hidden: task.hidden.clone(),
            on: ResidualOn::Accelerations,
            ..MlpSettings::for_joints(task.equations.joints)
        };
        let network = training.network(&settings, LastLayer::Zero, &mut rng);
        let model = HybridModel::physics(&task.equations, &self.backend.device())?;
        // Batches are full: no order is drawn.
        let order = residyn_core::rng(0);
        let settings = fit_settings(&task.settings);
        let mut run = Training::new(model.with_residual(&network)?, settings, order)?;
        run.run(&training, Some(&validation), &mut |at| {
            progress(&format!("epoch {} of {}", at.epoch, at.epochs));
            ControlFlow::Continue(())
        })?;
        let model = fading(&run.result()?, &training)?;
        let hybrid = model.to_dynamics()?;
        let run = run.ending_in(model)?;
        Ok(Some(TrainedResidual { run, hybrid }))
    }
}

/// The model with a residual that fades to zero far from these segments, where nothing supports it.
fn fading(model: &HybridModel, segments: &Segments) -> Result<HybridModel, TrainError> {
    let residual = model.weights().residual.expect("it has been trained");
    let rows: Vec<[Vec<f64>; 3]> = segments.rows().collect();
    Ok(model.clone().with_residual(&residual.fading(&rows))?)
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

/// Segments to train on, and to choose the epoch by.
fn segments(task: &ResidualTask) -> [Segments; 2] {
    let (joints, steps) = (task.equations.joints, task.settings.steps);
    let internal = task.equations.layout().internal().len();
    let sets = [&task.training, &task.validation];
    let rows: usize = sets.iter().copied().flatten().map(|s| s.time.len()).sum();
    let stride = (rows / task.settings.segments).max(1);
    sets.map(|blocks: &Vec<Trajectory>| {
        let mut set = Segments::new(joints, steps).with_internal(internal);
        for block in blocks {
            // A block that is too short holds no segment, which is not an error here.
            let _ = set.push_trajectory(&block.time, &block.states, &block.inputs, stride);
        }
        set
    })
}
