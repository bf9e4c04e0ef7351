//! Stage 8: train a small network on the residual of the refined model. The training itself is behind a trait, since it
//! needs tensors: see [`ResidualLearner`].

use std::error::Error;
use std::fmt::Debug;
use std::path::Path;

use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error_model::ErrorModel;
use super::fitted::Fitted;
use super::problem::Problem;
use super::refine::Refined;
use super::settings::LearnSettings;
use super::split::between;
use super::stage::{Progress, Stage, Watch};
use crate::data::{Log, Thinning, Trajectory};
use crate::model::{Dynamics, Origin};
use crate::sim::metric::assess;
use crate::sim::motions;

/// What a residual network is trained on.
#[derive(Debug)]
pub struct ResidualTask {
    /// The refined model, which is held.
    pub equations: Dynamics,
    /// Neurons of each hidden layer.
    pub hidden: Vec<usize>,
    /// Motion as the model sees it.
    pub training: Vec<Trajectory>,
    /// As above, to choose the epoch.
    pub validation: Vec<Trajectory>,
    pub settings: LearnSettings,
}

/// Trains residual networks.
pub trait ResidualLearner: Debug + Sync {
    /// Train a network on the residual of the equations and keep the epoch that predicts the validation blocks best;
    /// the untrained network is among the candidates. `None` if the blocks are too short. `progress` receives the
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
    fn save(&self, folder: &Path, origin: &Origin) -> Result<(), Box<dyn Error + Send + Sync>>;
}

/// Why a residual network could not be trained.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct LearnError(#[source] Box<dyn Error + Send + Sync>);

impl LearnError {
    pub fn new(error: impl Error + Send + Sync + 'static) -> Self {
        Self(Box::new(error))
    }
}

/// The residual network, and whether it helps on motion that it was not trained on.
pub struct Learned {
    /// If it is not used, an untrained network, which adds nothing; `None` if the model is not finite even without it.
    pub network: Option<Box<dyn LearnedResidual>>,
    pub check: NetworkCheck,
}

impl Learned {
    /// The equations with the network.
    pub fn hybrid(&self) -> Option<&Dynamics> {
        self.network.as_deref().map(LearnedResidual::hybrid)
    }
}

/// Open-loop position errors at the middle horizon on parts of the training logs, by networks trained on the other
/// parts; if a training failed, only on the parts before it.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct NetworkCheck {
    /// of the model without a network on each part, rad (or m)
    pub without: Vec<f64>,
    /// of the model with the network that was trained on the other parts
    pub with: Vec<f64>,
    /// whether the network is used; if not, it adds nothing
    pub used: bool,
    /// why a training could not be finished: where its loss was no longer finite. No network is used then
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

impl NetworkCheck {
    fn of(errors: &[[f64; 2]], settings: &LearnSettings) -> Self {
        let ratio = |[without, with]: &[f64; 2]| with / without;
        let total = |k: usize| errors.iter().map(|e| e[k].powi(2)).sum::<f64>().sqrt();
        let harms = errors.iter().any(|e| ratio(e) > settings.harmful_ratio);
        Self {
            without: errors.iter().map(|e| e[0]).collect(),
            with: errors.iter().map(|e| e[1]).collect(),
            // NaN if a prediction is not finite: the network is then not used.
            used: !harms && total(1) <= settings.helpful_ratio * total(0),
            failure: None,
        }
    }

    fn failed(self, failure: &LearnError) -> Self {
        Self {
            used: false,
            failure: Some(failure.to_string()),
            ..self
        }
    }
}

/// Train the residual network on the residual of the refined model, and keep it if it helps on parts of the logs that
/// it was not trained on. `None` if no network is requested or the logs are too few to train one.
pub fn learn(
    refined: &Refined<'_>,
    learner: Option<&dyn ResidualLearner>,
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Option<Learned> {
    let (problem, fitted) = (&refined.problem, &refined.after);
    // A network is trained on motion, and adds an acceleration to what the sensors show, of which the other side of a
    // transmission would know nothing.
    let learner = learner.filter(|_| {
        let has_transmission = fitted.model.dynamics().has_transmission();
        problem.error_model == ErrorModel::OutputError && !has_transmission
    })?;
    let mut tell = |text: &str| {
        let text = format!("{}, {text}", Stage::Learn.text());
        watch.see(Progress::within(Stage::Learn, &text));
    };
    let settings = &problem.settings.learn;
    let mut train = |logs: &[Log], epochs: usize| {
        let settings = LearnSettings {
            epochs,
            ..settings.clone()
        };
        learner.learn(&task(problem, fitted, logs, settings), rng, &mut tell)
    };
    let mut check = checked(problem, fitted, &mut |logs| train(logs, settings.epochs))?;
    if check.used {
        match train(problem.logs, settings.epochs) {
            Ok(network) => {
                let network = Some(network?);
                return Some(Learned { network, check });
            }
            Err(failure) => check = check.failed(&failure),
        }
    }
    // An untrained network adds nothing.
    let (network, check) = match train(problem.logs, 0) {
        Ok(network) => (Some(network?), check),
        Err(failure) => (None, check.failed(&failure)),
    };
    Some(Learned { network, check })
}

/// Trains a network on some of the logs.
type Train<'a> = dyn FnMut(&[Log]) -> Result<Option<Box<dyn LearnedResidual>>, LearnError> + 'a;

/// Whether networks help on parts of the logs that they were not trained on. `None` if the logs are too few to train
/// one.
fn checked(problem: &Problem<'_>, fitted: &Fitted, train: &mut Train<'_>) -> Option<NetworkCheck> {
    let settings = &problem.settings.learn;
    let parts = parts(problem.logs, settings.check_parts);
    let horizon_s = [problem.settings.score.middle_s()];
    let error = |model: &Dynamics, logs: &[Log]| assess(model, logs, &horizon_s).position_rms();
    let mut errors = Vec::new();
    for (k, left_out) in parts.iter().enumerate() {
        let others = parts.iter().enumerate().filter(|(other, _)| *other != k);
        let others: Vec<Log> = others.flat_map(|(_, logs)| logs.clone()).collect();
        match train(&others) {
            Ok(network) => {
                let with = error(network?.hybrid(), left_out);
                let without = error(&fitted.model.absorbed().dynamics(), left_out);
                errors.push([without, with]);
            }
            Err(failure) => return Some(NetworkCheck::of(&errors, settings).failed(&failure)),
        }
    }
    Some(NetworkCheck::of(&errors, settings))
}

/// The logs in `count` parts: whole logs in turn or, if there are fewer logs, pieces of each.
fn parts(logs: &[Log], count: usize) -> Vec<Vec<Log>> {
    if logs.len() >= count {
        let of = |part: usize| logs.iter().skip(part).step_by(count).cloned().collect();
        return (0..count).map(of).collect();
    }
    let piece = |log: &Log, part: usize| {
        let at = |k: usize| log.time[0] + log.duration() * k as f64 / count as f64;
        between(log, at(part), at(part + 1))
    };
    let of = |part: usize| logs.iter().map(|log| piece(log, part)).collect();
    (0..count).map(of).collect()
}

fn task(
    problem: &Problem<'_>,
    fitted: &Fitted,
    logs: &[Log],
    settings: LearnSettings,
) -> ResidualTask {
    // The checkpoint's model file has shifted parameters in their places, and so must the trained equations.
    let equations = fitted.model.absorbed().dynamics();
    let thinning = Thinning {
        step_s: settings.step_s,
        length_s: settings.block_s,
    };
    let dynamics = fitted.model.dynamics();
    let of_log = |log: &Log| motions(&*dynamics.in_log(log), log, thinning);
    let blocks = logs.iter().flat_map(of_log);
    let (mut training, mut validation) = (Vec::new(), Vec::new());
    for (k, block) in blocks.enumerate() {
        match (k + 1).is_multiple_of(settings.validation_every) {
            true => validation.push(block),
            false => training.push(block),
        }
    }
    ResidualTask {
        equations,
        hidden: problem.declared.hidden.clone(),
        training,
        validation,
        settings,
    }
}
