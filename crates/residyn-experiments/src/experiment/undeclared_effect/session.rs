use super::{Case, Experiment};
use crate::experiment::ExperimentError;
use residyn_control::control::Task;
use residyn_core::model::{Library, Model};
use residyn_core::plant::Plant;
use residyn_io::files::beside_or_named;
use residyn_io::read_model;
use residyn_io::read_plant;
use residyn_plants::{Controlled, Reach};
use residyn_train::Backend;

/// An experiment with everything it refers to read and checked.
pub struct Session {
    pub experiment: Experiment,
    pub library: Library,
    pub declared: Model,
    pub task: Task,
    /// The plants with what is known of them, one for each case.
    pub truths: Vec<Plant>,
    /// What is controlled, one for each case.
    pub plants: Vec<Controlled>,
    /// The task within the limits of the plant, one for each case.
    pub tasks: Vec<Task>,
    /// The backend that hybrids are trained on.
    pub backend: Backend,
    /// The first of the consecutive seeds.
    pub first_seed: u64,
}

impl Session {
    /// Reads everything that the experiment refers to. The seeds are `first_seed` and those that follow.
    ///
    /// # Errors
    /// Files that are missing or do not belong to the declared system.
    pub fn new(
        experiment: Experiment,
        library: Library,
        backend: Backend,
        first_seed: u64,
        reach: Reach,
    ) -> Result<Self, ExperimentError> {
        let model = beside_or_named(&experiment.path, &experiment.model);
        let declared = read_model(&model, &library)?;
        let task = Task::read(&beside_or_named(&experiment.path, &experiment.task))?;
        if task.system != declared.name {
            return Err(experiment.wrong(format!(
                "the task is for {}, but the model is of {}; give a matching pair",
                task.system, declared.name
            )));
        }
        let truth = |case: &Case| -> Result<Plant, ExperimentError> {
            let wrong =
                |message: String| experiment.wrong(format!("case `{}`: {message}", case.name));
            let mut plant =
                read_plant(&model, &library).map_err(|error| wrong(error.to_string()))?;
            let parameters = plant.set_parameters(&case.parameters);
            parameters.map_err(|error| wrong(error.to_string()))?;
            let hidden = plant.hide(&library, &case.effects);
            hidden.map_err(|error| wrong(error.to_string()))?;
            Ok(plant)
        };
        let truths: Vec<Plant> = (experiment.cases.iter())
            .map(truth)
            .collect::<Result<_, _>>()?;
        let plant =
            |(case, truth): (&Case, &Plant)| -> Result<(Controlled, Task), ExperimentError> {
                let mut same = task.clone();
                let Some(place) = &case.plant else {
                    return Ok((truth.clone().into(), same));
                };
                let plant = Controlled::open(place, Some(&experiment.path), &library, reach)?;
                let bound = plant.bound(&mut same, &declared);
                let fault = match bound {
                    Ok(()) if same.torque == task.torque => return Ok((plant, same)),
                    Ok(()) => "its limits are narrower than `torque` of the task".to_owned(),
                    Err(unsuited) => unsuited.to_string(),
                };
                Err(experiment.wrong(format!("case `{}`: {fault}", case.name)))
            };
        let plants: Vec<(Controlled, Task)> = (experiment.cases.iter().zip(&truths))
            .map(plant)
            .collect::<Result<_, _>>()?;
        let (plants, tasks) = plants.into_iter().unzip();
        Ok(Self {
            experiment,
            library,
            declared,
            task,
            truths,
            plants,
            tasks,
            backend,
            first_seed,
        })
    }
}
