use std::path::Path;

use rand::{Rng, RngExt};
use thiserror::Error;

use super::address::{Address, AddressError, Reach};
use super::description::{Clock, Description};
use super::error::RemoteError;
use super::fleet::Fleet;
use super::remote::Lateness;
use residyn_control::control::{DriveError, Driven, Simulated, Task};
use residyn_core::data::{Joint, Quantity};
use residyn_core::model::{Dynamics, Library, Model};
use residyn_core::plant::{Plant, PlantError};
use residyn_io::files::beside_or_named;
use residyn_io::read_plant;

/// What is controlled: a simulated rig, or a plant in another process.
pub enum Controlled {
    Simulated(Box<Simulation>),
    Elsewhere(Box<Fleet>),
}

/// A plant file and its equations.
pub struct Simulation {
    pub plant: Plant,
    pub dynamics: Dynamics,
}

/// The beginning of an episode.
pub struct Beginning<'b, R> {
    pub task: &'b Task,
    /// True positions, then velocities. A plant on the wall clock begins where it is.
    pub start: &'b [f64],
    /// Sensor noise of a simulated rig.
    pub noise: R,
    /// For what is random in a plant in another process.
    pub seed: u64,
    /// Where a plant in another process keeps its rows as they come.
    pub log: Option<&'b Path>,
}

/// Why there is no such plant.
#[derive(Debug, Error)]
pub enum ControlledError {
    #[error("{0}")]
    Address(#[from] AddressError),
    #[error("{0}")]
    Remote(#[from] RemoteError),
    #[error("{0}")]
    Simulated(#[from] PlantError),
}

/// A task that a plant cannot be given.
#[derive(Debug, Error)]
pub enum Unsuited {
    #[error(
        "the model {model} has {found} joints, but the plant {plant} has {joints}; plan with a model of the plant's system"
    )]
    Joints {
        model: String,
        found: usize,
        plant: String,
        joints: usize,
    },
    #[error(
        "the task {task} holds a command for {step_s} s, the plant {plant} for {of_plant_s} s; let them agree"
    )]
    Step {
        task: String,
        step_s: f64,
        plant: String,
        of_plant_s: f64,
    },
    #[error(
        "the plant {plant} takes commands from {low} to {high} on joint {joint}, and the task {task} plans none of them"
    )]
    Range {
        task: String,
        plant: String,
        joint: usize,
        low: f64,
        high: f64,
    },
}

/// The seed of a plant in another process, of a stream's numbers from here on; JSON can say it.
pub fn plant_seed(draws: &(impl Rng + Clone)) -> u64 {
    draws.clone().random_range(0..1 << 53)
}

impl From<Plant> for Controlled {
    fn from(plant: Plant) -> Self {
        let dynamics = plant.dynamics();
        Self::Simulated(Box::new(Simulation { plant, dynamics }))
    }
}

impl Controlled {
    /// The plant at an address, or the one in a file or of this name; `named_in` is the file that names it, if one does.
    ///
    /// # Errors
    /// An address that is wrong or out of reach, a plant that does not answer, a file that cannot be read.
    pub fn open(
        plant: &Path,
        named_in: Option<&Path>,
        library: &Library,
        reach: Reach,
    ) -> Result<Self, ControlledError> {
        if let Some(address) = Address::in_text(plant, reach) {
            return Ok(Self::Elsewhere(Box::new(Fleet::open(address?)?)));
        }
        let file = named_in.map_or_else(|| plant.to_owned(), |by| beside_or_named(by, plant));
        Ok(read_plant(&file, library)?.into())
    }

    /// Its name, or that of its system.
    pub fn name(&self) -> &str {
        match self {
            Self::Simulated(simulation) => &simulation.plant.system.name,
            Self::Elsewhere(fleet) => &fleet.description().name,
        }
    }

    /// Number of its joints.
    pub fn joints(&self) -> usize {
        match self {
            Self::Simulated(simulation) => simulation.plant.system.joints,
            Self::Elsewhere(fleet) => fleet.description().joints.len(),
        }
    }

    /// What drives it.
    pub fn driven_by(&self) -> Quantity {
        match self {
            Self::Simulated(simulation) => simulation.plant.system.driven_by(),
            Self::Elsewhere(fleet) => fleet.description().command.quantity(),
        }
    }

    /// A joint's name for people.
    pub fn joint_label(&self, joint: Joint) -> String {
        match self {
            Self::Simulated(simulation) => simulation.plant.system.joint_label(joint),
            Self::Elsewhere(fleet) => fleet.description().joints[joint.index()].clone(),
        }
    }

    /// Whether a joint slides; a plant in another process does not say so.
    pub fn slides(&self, joint: Joint) -> bool {
        match self {
            Self::Simulated(simulation) => simulation.plant.system.prismatic[joint],
            Self::Elsewhere(_) => false,
        }
    }

    /// What a plant in another process says of itself.
    pub fn description(&self) -> Option<&Description> {
        match self {
            Self::Simulated(_) => None,
            Self::Elsewhere(fleet) => Some(fleet.description()),
        }
    }

    /// Whether only one of it can be driven at a time.
    pub fn is_single(&self) -> bool {
        match self {
            Self::Simulated(_) => false,
            Self::Elsewhere(fleet) => fleet.is_single(),
        }
    }

    /// Whether it moves by itself, so that no motion can be repeated.
    pub fn moves_by_itself(&self) -> bool {
        (self.description()).is_some_and(|description| description.clock == Clock::Wall)
    }

    /// How late commands came to a plant that moves by itself, in the newest episode.
    pub fn lateness(&self) -> Option<Lateness> {
        match self {
            Self::Elsewhere(fleet) if self.moves_by_itself() => Some(fleet.lateness()),
            _ => None,
        }
    }

    /// Steps until a command acts, as measured in the newest episode.
    pub fn latency(&self) -> usize {
        self.lateness().map_or(0, |lateness| lateness.latency())
    }

    /// Keep the commands of a task that is planned with `model` within the plant's limits, and the states of its plans as far as
    /// they can be.
    ///
    /// # Errors
    /// A model or task of another plant.
    pub fn bound(&self, task: &mut Task, model: &Model) -> Result<(), Unsuited> {
        if model.joints != self.joints() {
            return Err(Unsuited::Joints {
                model: model.name.clone(),
                found: model.joints,
                plant: self.name().to_owned(),
                joints: self.joints(),
            });
        }
        self.description()
            .map_or(Ok(()), |description| description.bound(task))
    }

    /// Do something with a plant that begins an episode.
    ///
    /// # Errors
    /// A plant in another process that cannot be reached or put at the start, and the errors of what is done.
    pub fn during<T, E: From<DriveError>>(
        &self,
        beginning: Beginning<'_, impl Rng>,
        act: impl FnOnce(&mut dyn Driven) -> Result<T, E>,
    ) -> Result<T, E> {
        let Beginning {
            task,
            start,
            noise,
            seed,
            log,
        } = beginning;
        match self {
            Self::Simulated(simulation) => {
                let rig = task.rig(&simulation.plant, &simulation.dynamics, start);
                act(&mut Simulated { rig, noise })
            }
            Self::Elsewhere(fleet) => fleet.during(Some(start), seed, log, act),
        }
    }
}
