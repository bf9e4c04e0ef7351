use super::learning::TrainedMethod;
use super::results::{Course, Results};
use super::{ExperimentError, Observer, Session, offline_prior, physics_prior, receding_horizon};
use crate::runs::{Identity, RunFolder, Shard};

/// The published experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Experiment {
    PhysicsPrior,
    OfflinePrior,
    RecedingHorizon,
}

impl Experiment {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::PhysicsPrior => physics_prior::NAME,
            Self::OfflinePrior => offline_prior::NAME,
            Self::RecedingHorizon => receding_horizon::NAME,
        }
    }

    fn check(self, session: &Session) -> Result<(), String> {
        match self {
            Self::PhysicsPrior => physics_prior::check(session),
            Self::OfflinePrior => offline_prior::check(session),
            Self::RecedingHorizon => receding_horizon::check(session),
        }
    }
}

impl Session {
    /// Carries out an experiment in its folder, or the rest of one that was interrupted.
    ///
    /// # Errors
    /// A configuration of another experiment, the folder of another run, a run that diverges, or files that cannot be read
    /// or written.
    pub fn carry_out(
        &self,
        experiment: Experiment,
        folder: &RunFolder,
        observer: Observer<'_>,
    ) -> Result<Results, ExperimentError> {
        let run = self.claim(experiment, folder)?;
        let learnt = self.learn(folder, observer)?;
        let (name, task) = (experiment.name(), self.task.name());
        let mut results = Results::new(name, &task, self.seeds(), run.config);
        match experiment {
            Experiment::PhysicsPrior | Experiment::OfflinePrior => {
                self.learning_curves(&learnt, &mut results)?;
            }
            Experiment::RecedingHorizon => receding_horizon::compare(self, &learnt, &mut results)?,
        }
        Ok(results)
    }

    /// Carries out a shard of the runs of an experiment in its folder, or the rest of them. What is evaluated without
    /// learning is left to [`Session::carry_out`].
    ///
    /// # Errors
    /// As [`Session::carry_out`].
    pub fn carry_out_shard(
        &self,
        experiment: Experiment,
        shard: Shard,
        folder: &RunFolder,
        observer: Observer<'_>,
    ) -> Result<(), ExperimentError> {
        self.claim(experiment, folder)?;
        self.learn_shard(shard, folder, observer).map(drop)
    }

    /// What decides the numbers of an experiment.
    pub fn run_of_experiment(&self, experiment: Experiment) -> Identity {
        self.identity(experiment.name(), self.resolved())
    }

    /// Take a folder for an experiment.
    fn claim(
        &self,
        experiment: Experiment,
        folder: &RunFolder,
    ) -> Result<Identity, ExperimentError> {
        experiment
            .check(self)
            .map_err(|message| self.config.wrong(message))?;
        let run = self.run_of_experiment(experiment);
        folder.claim(&run)?;
        Ok(run)
    }

    /// Evaluates the return of every method against the number of real transitions.
    fn learning_curves(
        &self,
        learnt: &[Vec<TrainedMethod>],
        results: &mut Results,
    ) -> Result<(), ExperimentError> {
        for (method, runs) in self.methods.iter().zip(learnt) {
            let rounds = (0..method.config.rounds).map(|round| {
                let score = runs
                    .iter()
                    .map(|run| run.rounds[round].score.clone())
                    .collect();
                (runs[0].rounds[round].transitions, score)
            });
            results
                .methods
                .insert(method.config.name.clone(), rounds.collect());
        }
        let replan = self.task.replan;
        for (name, predictor) in self.fixed()? {
            let score = self.score_all(|_| predictor.clone(), replan, name)?;
            results
                .methods
                .insert(name.to_owned(), Course::from_iter([(0, score)]));
        }
        Ok(())
    }
}
