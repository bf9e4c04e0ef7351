use std::path::PathBuf;

use super::data::{Data, Logged, Simulated};
use super::{Kind, Recipe, RecipeError};
use crate::{Segments, SegmentsError};
use residyn_core::data::{Log, Thinning, Trajectory, trajectories};
use residyn_core::model::{Library, Model};
use residyn_core::sim::motions;
use residyn_core::streams::{Purpose, stream};
use residyn_io::files::{beside, beside_or_named};
use residyn_io::read_log;
use residyn_io::read_plant;

/// The data of a recipe, read or sampled.
pub struct TrainingData {
    pub training: Segments,
    /// As many other segments of the plant, for testing; none with logs.
    pub test: Option<Segments>,
    /// Names and true values of the parameters of a simulated plant.
    pub truth: Vec<(String, f64)>,
    /// Remarks on the logs, one sentence each.
    pub notes: Vec<String>,
}

impl TrainingData {
    /// Reads the logs or samples the plant.
    ///
    /// # Errors
    /// Unreadable logs, logs that are too short, another number of joints, or a plant that diverges.
    pub fn load(
        recipe: &Recipe,
        model: &Model,
        library: &Library,
        seed: u64,
    ) -> Result<Self, RecipeError> {
        match &recipe.data {
            Data::Logged(logged) => from_logs(recipe, logged, model),
            Data::Simulated(simulated) => from_plant(recipe, simulated, model, library, seed),
        }
    }
}

fn from_logs(recipe: &Recipe, logged: &Logged, model: &Model) -> Result<TrainingData, RecipeError> {
    let read = |path: &PathBuf| read_log(beside(&recipe.path, path), model);
    let logs: Vec<Log> = logged.logs.iter().map(read).collect::<Result<_, _>>()?;
    let thinning = Thinning {
        step_s: logged.step_s,
        length_s: f64::INFINITY,
    };
    let dynamics = model.dynamics();
    let motions = |log: &Log| match recipe.kind {
        // A network alone has no effects: it learns from the commanded torques and the sensor readings.
        Kind::DataDriven => trajectories(log, &[], thinning),
        Kind::Hybrid | Kind::Physics => motions(&dynamics, log, thinning),
    };
    let internal = match recipe.kind {
        Kind::DataDriven => 0,
        Kind::Hybrid | Kind::Physics => dynamics.layout().internal().len(),
    };
    let mut training = Segments::new(model.joints, logged.steps).with_internal(internal);
    for log in &logs {
        let before = training.len();
        for trajectory in motions(log) {
            // A trajectory between gaps may be too short for a segment; a log without any segment is refused below.
            if trajectory.time.len() > logged.steps {
                push(&mut training, &trajectory).map_err(in_file(&log.path))?;
            }
        }
        if training.len() == before {
            let (rows, steps) = (log.rows(), logged.steps);
            return Err(in_file(&log.path)(SegmentsError::TooShort { rows, steps }));
        }
    }
    let notes = logs.iter().flat_map(|log| {
        log.notes
            .iter()
            .map(|note| format!("{}: {note}", log.name()))
    });
    Ok(TrainingData {
        training,
        test: None,
        truth: Vec::new(),
        notes: notes.collect(),
    })
}

fn from_plant(
    recipe: &Recipe,
    simulated: &Simulated,
    model: &Model,
    library: &Library,
    seed: u64,
) -> Result<TrainingData, RecipeError> {
    let of_plant = |source| RecipeError::Plant {
        path: recipe.path.clone(),
        source,
    };
    let path = beside_or_named(&recipe.path, &simulated.plant);
    let plant = read_plant(&path, library).map_err(of_plant)?;
    if plant.system.name != model.name || plant.system.joints != model.joints {
        return Err(recipe.wrong(format!(
            "[data]: the plant's system is {} with {} joints, but `model` is {} with {}; name a plant of the \
             same system",
            plant.system.name, plant.system.joints, model.name, model.joints
        )));
    }
    let draw = |purpose| {
        let drawn = plant.sample(&simulated.sampling, &mut stream(seed, purpose));
        let mut segments = Segments::new(model.joints, simulated.steps);
        for trajectory in drawn.map_err(of_plant)? {
            push(&mut segments, &trajectory).map_err(in_file(&recipe.path))?;
        }
        Ok::<_, RecipeError>(segments)
    };
    let names = plant.system.parameters.iter().map(|p| p.name.clone());
    Ok(TrainingData {
        training: draw(Purpose::RecipeTraining)?,
        test: Some(draw(Purpose::RecipeTest)?),
        truth: names.zip(plant.parameters.iter().copied()).collect(),
        notes: Vec::new(),
    })
}

fn push(segments: &mut Segments, trajectory: &Trajectory) -> Result<(), SegmentsError> {
    let Trajectory {
        time,
        states,
        inputs,
    } = trajectory;
    segments.push_trajectory(time, states, inputs, 1)
}

fn in_file(path: &std::path::Path) -> impl Fn(SegmentsError) -> RecipeError {
    let path = path.to_owned();
    move |source| RecipeError::Segments {
        path: path.clone(),
        source,
    }
}
