use super::results::{Course, Results};
use super::{ExperimentError, Observer, Session, offline_prior, physics_prior, receding_horizon};
use residyn_io::runs::{Identity, RunFolder, Shard};

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

    /// The receding horizons to compare; `None` if amounts of data are compared.
    fn horizons(self, session: &Session) -> Option<&[usize]> {
        match self {
            Self::PhysicsPrior | Self::OfflinePrior => None,
            Self::RecedingHorizon => Some(&session.config.replan),
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
        let horizons = experiment.horizons(self);
        let done = self.do_shard(Shard::WHOLE, horizons, folder, observer)?;
        let (name, task) = (experiment.name(), self.task.name());
        let mut results = Results::new(name, &task, self.seeds(), run.config);
        results.receding_horizon = horizons.map(<[usize]>::to_vec);
        let courses = done.into_iter();
        results.methods = courses
            .map(|(name, seeds)| (name, Course::from(seeds)))
            .collect();
        Ok(results)
    }

    /// Carries out a shard of an experiment in its folder, or the rest of it.
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
        self.do_shard(shard, experiment.horizons(self), folder, observer)
            .map(drop)
    }

    /// What determines the numbers of an experiment.
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
}
