use std::path::PathBuf;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::data::{Data, Logged, Simulated};
use super::job::equations;
use super::{Kind, Recipe, RecipeError};
use crate::data::{Log, Thinning, Trajectory, trajectories};
use crate::model::{Library, System};
use crate::plant::Plant;
use crate::sim::as_modelled;
use crate::train::{Segments, SegmentsError};

/// What a seed is used for: each purpose draws from a stream of its own, so that more draws for one do
/// not change the others.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    Training,
    Test,
    Network,
    Order,
}

/// The random numbers for one purpose.
pub(super) fn stream(seed: u64, purpose: Purpose) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(purpose as u64);
    rng
}

/// The data of a recipe, ready for training.
pub struct Material {
    pub training: Segments,
    /// As many other segments of the plant, to judge by; none with logs.
    pub test: Option<Segments>,
    /// Name and true value of the parameters of a simulated plant.
    pub truth: Vec<(String, f64)>,
    /// What a reader of the logs should know, one sentence each.
    pub notes: Vec<String>,
}

impl Material {
    /// Read or draw the data.
    ///
    /// # Errors
    /// Unreadable logs, another number of joints, a plant that diverges, logs that are too short.
    pub fn gather(
        recipe: &Recipe,
        system: &System,
        library: &Library,
        seed: u64,
    ) -> Result<Self, RecipeError> {
        match &recipe.data {
            Data::Logged(logged) => from_logs(recipe, logged, system),
            Data::Simulated(simulated) => from_plant(recipe, simulated, system, library, seed),
        }
    }
}

fn from_logs(recipe: &Recipe, logged: &Logged, system: &System) -> Result<Material, RecipeError> {
    let read = |path: &PathBuf| Log::read(recipe.beside(path), system.joints, &system.columns);
    let logs: Vec<Log> = logged.logs.iter().map(read).collect::<Result<_, _>>()?;
    let thinning = Thinning {
        step_s: logged.step_s,
        length_s: f64::INFINITY,
    };
    let dynamics = equations(system);
    let modelled = |log: &Log| match recipe.kind {
        // A network alone has no effects: it learns from what was commanded and shown.
        Kind::DataDriven => log.clone(),
        Kind::Hybrid | Kind::Physics => as_modelled(&dynamics, log),
    };
    let mut training = Segments::new(system.joints, logged.steps);
    for log in &logs {
        let before = training.len();
        for trajectory in trajectories(&modelled(log), thinning) {
            // A gap may leave a piece that holds no segment; a log without any is refused below.
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
    Ok(Material {
        training,
        test: None,
        truth: Vec::new(),
        notes: notes.collect(),
    })
}

fn from_plant(
    recipe: &Recipe,
    simulated: &Simulated,
    system: &System,
    library: &Library,
    seed: u64,
) -> Result<Material, RecipeError> {
    let of_plant = |source| RecipeError::Plant {
        path: recipe.path.clone(),
        source,
    };
    let path = recipe.beside_or_named(&simulated.plant);
    let plant = Plant::read(&path, library).map_err(of_plant)?;
    if plant.system.name != system.name || plant.system.joints != system.joints {
        return Err(recipe.wrong(format!(
            "[data]: the plant's system is {} with {} joints, but `model` is {} with {}; name a plant of the \
             same system",
            plant.system.name, plant.system.joints, system.name, system.joints
        )));
    }
    let draw = |purpose| {
        let drawn = plant.sample(&simulated.sampling, &mut stream(seed, purpose));
        let mut segments = Segments::new(system.joints, simulated.steps);
        for trajectory in drawn.map_err(of_plant)? {
            push(&mut segments, &trajectory).map_err(in_file(&recipe.path))?;
        }
        Ok::<_, RecipeError>(segments)
    };
    let names = plant.system.parameters.iter().map(|p| p.name.clone());
    Ok(Material {
        training: draw(Purpose::Training)?,
        test: Some(draw(Purpose::Test)?),
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
