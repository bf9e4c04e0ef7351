use rayon::prelude::*;

use super::{Case, Experiment, Outcome, Trial};
use crate::control::Task;
use crate::experiment::ExperimentError;
use crate::files::beside_or_named;
use crate::model::{Library, Model};
use crate::plant::Plant;
use crate::runs::RunFolder;
use crate::train::Backend;

/// An experiment with everything it refers to read and checked.
pub struct Lab {
    pub experiment: Experiment,
    pub library: Library,
    pub declared: Model,
    pub task: Task,
    /// One for each case.
    pub plants: Vec<Plant>,
    /// The backend that hybrids are trained on.
    pub backend: Backend,
    /// The first of the consecutive seeds.
    pub first_seed: u64,
}

impl Lab {
    /// Reads everything that the experiment refers to. The seeds are `first_seed` and those that follow.
    ///
    /// # Errors
    /// Files that are missing or not of the declared system.
    pub fn new(
        experiment: Experiment,
        library: Library,
        backend: Backend,
        first_seed: u64,
    ) -> Result<Self, ExperimentError> {
        let model = beside_or_named(&experiment.path, &experiment.model);
        let declared = library.model(&model)?;
        let task = Task::read(&beside_or_named(&experiment.path, &experiment.task))?;
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
            first_seed,
        })
    }

    /// Carries out the trials that are not in the folder yet. `observer` is called after each trial.
    ///
    /// # Errors
    /// A trial that cannot be carried out, or a folder that cannot be written or holds another run.
    pub fn run(
        &self,
        folder: &RunFolder,
        observer: &(impl Fn(&Trial) + Sync),
    ) -> Result<Outcome, ExperimentError> {
        folder.claim(&self.identity())?;
        let runs = folder.within("runs");
        let cases = 0..self.experiment.cases.len();
        let trials: Vec<(usize, u64)> = cases
            .flat_map(|case| (0..self.experiment.seeds).map(move |k| (case, self.first_seed + k)))
            .collect();
        let trial = |&(case, seed): &(usize, u64)| {
            let trial = self.trial_in(&runs, case, seed)?;
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
