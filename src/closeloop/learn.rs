//! Stage 8: train a small network on the residual of the refined model. The training itself is behind a trait, since it
//! needs tensors: see [`ResidualLearner`].

use std::error::Error;
use std::fmt::Debug;
use std::path::Path;

use rand::Rng;

use super::fitted::Fitted;
use super::refine::Refined;
use super::settings::LearnSettings;
use super::stage::{Progress, Stage};
use super::study::Study;
use crate::data::{Log, Thinning, Trajectory, trajectories};
use crate::model::{Dynamics, Origin};
use crate::sim::as_modelled;

/// What a residual network is trained on.
#[derive(Debug)]
pub struct ResidualTask {
    /// The refined model, which is held.
    pub equations: Dynamics,
    /// Neurons of each hidden layer.
    pub hidden: Vec<usize>,
    /// Motion as the model sees it.
    pub training: Vec<Trajectory>,
    /// The same, to choose the epoch by.
    pub validation: Vec<Trajectory>,
    pub settings: LearnSettings,
}

/// Trains residual networks.
pub trait ResidualLearner: Debug + Sync {
    /// Train a network on what the equations leave and keep the epoch that predicts the validation stretches best; the
    /// untrained network is among the candidates. `None` where the stretches are too short. `progress` receives the
    /// epoch.
    ///
    /// # Errors
    /// A loss that is no longer finite.
    fn learn(
        &self,
        task: &ResidualTask,
        rng: &mut dyn Rng,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Box<dyn LearnedResidual>>, LearnError>;
}

/// A residual network that was trained.
pub trait LearnedResidual: Send {
    /// The equations with the network, as one program.
    fn hybrid(&self) -> &Dynamics;

    /// Write the trained model as a checkpoint.
    ///
    /// # Errors
    /// A folder that cannot be written, or that holds something other than a checkpoint.
    fn save(&self, folder: &Path, origin: &Origin) -> Result<(), LearnError>;
}

/// Why a residual network could not be trained or saved.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct LearnError(Box<dyn Error + Send + Sync>);

impl LearnError {
    pub fn new(error: impl Error + Send + Sync + 'static) -> Self {
        Self(Box::new(error))
    }
}

/// Train the residual network on what the refined model leaves. `None` where no network is asked for or the logs are
/// too few to train it.
pub(super) fn learn(
    refined: &Refined<'_>,
    learner: Option<&dyn ResidualLearner>,
    rng: &mut impl Rng,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Option<Box<dyn LearnedResidual>>, LearnError> {
    let Some(learner) = learner else {
        return Ok(None);
    };
    let task = task(&refined.study, &refined.after);
    learner.learn(&task, rng, &mut |text| {
        let text = format!("{}, {text}", Stage::Learn.text());
        progress(Progress::within(Stage::Learn, &text));
    })
}

fn task(study: &Study<'_>, fitted: &Fitted) -> ResidualTask {
    let settings = study.settings.learn.clone();
    // The checkpoint's own model file has shifted parameters in their places, and so must what is trained.
    let equations = fitted.model.absorbed().dynamics();
    let thinning = Thinning {
        step_s: settings.step_s,
        length_s: settings.stretch_s,
    };
    let dynamics = fitted.model.dynamics();
    let of_log = |log: &Log| trajectories(&as_modelled(&*dynamics.in_log(log), log), thinning);
    let stretches = study.logs.iter().flat_map(of_log);
    let (mut training, mut validation) = (Vec::new(), Vec::new());
    for (k, stretch) in stretches.enumerate() {
        match (k + 1).is_multiple_of(settings.every) {
            true => validation.push(stretch),
            false => training.push(stretch),
        }
    }
    ResidualTask {
        equations,
        hidden: study.declared.hidden.clone(),
        training,
        validation,
        settings,
    }
}
