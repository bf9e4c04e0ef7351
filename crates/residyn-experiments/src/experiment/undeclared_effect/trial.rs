use rand::Rng;
use serde::{Deserialize, Serialize};

use super::Session;
use crate::experiment::ExperimentError;
use crate::mbrl::{EpisodeScore, Evaluator, Learner, Prior, RunError, transitions};
use residyn_control::control::Predictor;
use residyn_core::closeloop::{
    Finding, Outcome, Request, Settings, Split, StudyError, Verdict, close_loop,
};
use residyn_core::data::{Joint, Log};
use residyn_core::model::Dynamics;
use residyn_core::streams::{Purpose, stream};

/// One plant under control with every model, with the same initial state, sensor noise and random numbers of the planner.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    pub case: String,
    pub seed: u64,
    pub scores: Vec<ModelScore>,
    /// The results of closing the loop, one per number of episodes.
    pub closed: Vec<Closed>,
}

/// The result of an episode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelScore {
    pub model: PlanningModel,
    /// Number of episodes that the model was fitted to.
    pub episodes: usize,
    #[serde(flatten)]
    pub episode: EpisodeScore,
}

/// A kind of model to plan with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanningModel {
    /// The model file as it is.
    Declared,
    /// With the parameters and effects from closing the loop.
    Closed,
    /// With trained parameters and a residual network.
    Hybrid,
    /// The plant's own equations.
    True,
}

/// A result of closing the loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Closed {
    pub episodes: usize,
    pub verdict: Verdict,
    pub effects: Vec<NamedEffect>,
    /// Declared parameters and their fitted values.
    pub parameters: Vec<(String, f64)>,
}

/// An effect in the result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedEffect {
    pub name: String,
    pub joint: Joint,
    pub parameters: Vec<(String, f64)>,
}

impl PlanningModel {
    /// The name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Declared => "declared",
            Self::Closed => "closed",
            Self::Hybrid => "hybrid",
            Self::True => "true",
        }
    }
}

impl Closed {
    fn new(episodes: usize, outcome: &Outcome) -> Self {
        let parameter = |p: &residyn_core::model::Parameter| (p.name.clone(), p.value);
        let named = |finding: &Finding| NamedEffect {
            name: finding.effect.title(),
            joint: finding.effect.joint,
            parameters: finding.parameters.iter().map(parameter).collect(),
        };
        Self {
            episodes,
            verdict: outcome.verdict,
            effects: outcome.effects.findings.iter().map(named).collect(),
            parameters: (outcome.models.after.model.absorbed().parameters.iter())
                .map(parameter)
                .collect(),
        }
    }
}

impl Session {
    /// Drives the plant of a case with every model. The first episode of data is gathered with the declared model, the
    /// next ones with the model closed on the first.
    ///
    /// # Errors
    /// A plant that diverges, a loss that is not finite, or logs on which the loop cannot be closed.
    pub fn trial(&self, case: usize, seed: u64) -> Result<Trial, ExperimentError> {
        let name = || self.experiment.cases[case].name.clone();
        let failed = |source: RunError| ExperimentError::Run {
            method: name(),
            seed,
            source,
        };
        let learner = self.learner();
        let evaluator = self.evaluator(case, seed);
        let score =
            |model, episodes, predictor: &Predictor| -> Result<ModelScore, ExperimentError> {
                let episode = evaluator.score(predictor, self.task.replan);
                Ok(ModelScore {
                    model,
                    episodes,
                    episode: episode.map_err(failed)?,
                })
            };
        let declared = self.predictor(self.declared.dynamics());
        let truth = self.predictor(self.truths[case].dynamics());
        let mut scores = vec![score(PlanningModel::Declared, 0, &declared)?];
        let mut closed = Vec::new();
        let mut logs = Vec::new();
        let mut best = declared;
        for &episodes in &self.experiment.episodes {
            while logs.len() < episodes {
                logs.push(self.gather(evaluator, &best, logs.len()).map_err(failed)?);
            }
            let outcome = self
                .close(&logs, seed)
                .map_err(|source| ExperimentError::Study {
                    case: name(),
                    seed,
                    source,
                })?;
            closed.push(Closed::new(episodes, &outcome));
            best = self.predictor(outcome.models.after.model.dynamics());
            scores.push(score(PlanningModel::Closed, episodes, &best)?);
            let hybrid = self.hybrid(&learner, &logs, seed).map_err(failed)?;
            scores.push(score(PlanningModel::Hybrid, episodes, &hybrid)?);
        }
        scores.push(score(PlanningModel::True, 0, &truth)?);
        Ok(Trial {
            case: name(),
            seed,
            scores,
            closed,
        })
    }

    fn predictor(&self, dynamics: Dynamics) -> Predictor {
        Predictor::of_equations(dynamics, self.task.integrator)
    }

    fn learner(&self) -> Learner {
        Learner {
            system: self.declared.name.clone(),
            joints: self.declared.joints,
            prior: Prior::Equations(Box::new(self.declared.dynamics())),
            network: self.experiment.network.clone(),
            fit: self.experiment.fit.clone(),
            backend: self.backend,
        }
    }

    fn evaluator(&self, case: usize, seed: u64) -> Evaluator<'_> {
        Evaluator {
            task: &self.tasks[case],
            plant: &self.plants[case],
            seed,
        }
    }

    /// The log of an episode with its own initial state and random numbers.
    fn gather(
        &self,
        evaluator: Evaluator<'_>,
        model: &Predictor,
        number: usize,
    ) -> Result<Log, RunError> {
        let seed = stream(evaluator.seed, Purpose::Gather(number)).next_u64();
        let episode = Evaluator { seed, ..evaluator }.episode(model, self.task.replan)?;
        let mut log = episode.stretch.log;
        log.path = format!("episode{}.csv", number + 1).into();
        Ok(log)
    }

    fn close(&self, logs: &[Log], seed: u64) -> Result<Outcome, StudyError> {
        let split = Split::of(logs.to_vec(), &Settings::default().split);
        let declared = self.declared.for_sent_torques();
        let request = Request::new(&declared, &self.library, split);
        let mut rng = stream(seed, Purpose::Other(logs.len()));
        close_loop(request, &mut rng, &())
    }

    fn hybrid(&self, learner: &Learner, logs: &[Log], seed: u64) -> Result<Predictor, RunError> {
        let segments = transitions(logs, learner.joints)?;
        let training = learner.learn(&segments, None, seed, logs.len())?;
        let model = training.result()?;
        Ok(model.predictor(learner.fit.integrator))
    }
}
