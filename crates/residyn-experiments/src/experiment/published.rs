use super::results::{Course, Results};
use super::{ExperimentError, Observer, Session, offline_prior, physics_prior, receding_horizon};
use residyn_io::runs::{Identity, RunFolder, Shard};

/// A published experiment.
#[derive(Debug)]
pub struct Experiment {
    /// The name on the command line.
    pub name: &'static str,
    /// Whether a configuration is one of this experiment, and what it lacks if not.
    pub(super) check: fn(&Session) -> Result<(), String>,
    /// The receding horizons to compare; `None` if amounts of data are compared.
    pub(super) horizons: fn(&Session) -> Option<&[usize]>,
}

/// All published experiments.
pub static EXPERIMENTS: [Experiment; 3] = [
    physics_prior::EXPERIMENT,
    offline_prior::EXPERIMENT,
    receding_horizon::EXPERIMENT,
];

impl Session {
    /// Carries out a shard of an experiment in its folder, or the rest of one that was interrupted; returns the results
    /// of its pieces.
    ///
    /// # Errors
    /// A configuration of another experiment, the folder of another run, a run that diverges, or files that cannot be read
    /// or written.
    pub fn carry_out(
        &self,
        experiment: &Experiment,
        shard: Shard,
        folder: &RunFolder,
        observer: Observer<'_>,
    ) -> Result<Results, ExperimentError> {
        (experiment.check)(self).map_err(|message| self.config.wrong(message))?;
        let run = self.run_of_experiment(experiment);
        folder.claim(&run)?;
        let horizons = (experiment.horizons)(self);
        let courses = self
            .do_shard(shard, horizons, folder, observer)?
            .into_iter();
        let task = self.task.name();
        let mut results = Results::new(experiment.name, &task, self.seeds(), run.config);
        results.receding_horizon = horizons.map(<[usize]>::to_vec);
        results.methods = courses
            .map(|(name, seeds)| (name, Course::from(seeds)))
            .collect();
        Ok(results)
    }

    /// What determines the numbers of an experiment.
    pub fn run_of_experiment(&self, experiment: &Experiment) -> Identity {
        self.identity(experiment.name, self.resolved())
    }
}
