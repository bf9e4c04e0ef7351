use std::path::Path;

use rayon::prelude::*;

use super::runs::Runs;
use super::{Case, Experiment, Outcome, Trial};
use crate::control::Task;
use crate::experiment::ExperimentError;
use crate::model::{Library, Model};
use crate::plant::Plant;
use crate::train::Backend;

/// All that an experiment takes, checked.
pub struct Lab {
    pub experiment: Experiment,
    pub library: Library,
    pub declared: Model,
    pub task: Task,
    /// One for each case.
    pub plants: Vec<Plant>,
    /// Where hybrids are trained.
    pub backend: Backend,
}

impl Lab {
    /// Look for everything that the experiment names.
    ///
    /// # Errors
    /// What is missing, or does not belong to the declared system.
    pub fn new(
        experiment: Experiment,
        library: Library,
        backend: Backend,
    ) -> Result<Self, ExperimentError> {
        let model = experiment.beside_or_named(&experiment.model);
        let declared = library.model(&model)?;
        let task = Task::read(&experiment.beside_or_named(&experiment.task))?;
        if task.system != declared.name {
            return Err(experiment.wrong(format!(
                "the task is for {}, the model is of {}; give those that belong together",
                task.system, declared.name
            )));
        }
        let plant = |case: &Case| -> Result<Plant, ExperimentError> {
            let told =
                |message: String| experiment.wrong(format!("case `{}`: {message}", case.name));
            let mut plant =
                Plant::read(&model, &library).map_err(|error| told(error.to_string()))?;
            plant.set_parameters(&case.parameters).map_err(told)?;
            let hidden = plant.hide(&library, &case.effects);
            hidden.map_err(|error| told(error.to_string()))?;
            Ok(plant)
        };
        let plants = experiment
            .cases
            .iter()
            .map(plant)
            .collect::<Result<_, _>>()?;
        Ok(Self {
            experiment,
            library,
            declared,
            task,
            plants,
            backend,
        })
    }

    /// Carry out what is not in `dir` yet, where each trial is a file. `observer` is told of each that is done.
    ///
    /// # Errors
    /// A trial that cannot be carried out, or a folder that cannot be written or holds another experiment.
    pub fn run(
        &self,
        dir: &Path,
        observer: &(impl Fn(&Trial) + Sync),
    ) -> Result<Outcome, ExperimentError> {
        let runs = Runs::open(dir)?;
        let cases = 0..self.experiment.cases.len();
        let trials: Vec<(usize, u64)> = cases
            .flat_map(|case| (0..self.experiment.seeds).map(move |seed| (case, seed)))
            .collect();
        let trial = |&(case, seed): &(usize, u64)| {
            let trial = runs.get_or(self, case, seed, || self.trial(case, seed))?;
            observer(&trial);
            Ok(trial)
        };
        let trials: Vec<Trial> = trials
            .par_iter()
            .map(trial)
            .collect::<Result<_, ExperimentError>>()?;
        Ok(Outcome::new(self, &trials))
    }
}
