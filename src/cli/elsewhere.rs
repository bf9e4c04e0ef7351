use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;

use residyn_core::model::Library;
use residyn_experiments::experiment::Config;
use residyn_plants::{Controlled, Reach};

/// How far away a plant in another process may be.
#[derive(Debug, Args)]
pub(super) struct Elsewhere {
    /// Connect to a tcp: plant on another machine, over a network that nothing protects
    #[arg(long)]
    plant_elsewhere: bool,
}

impl Elsewhere {
    pub(super) fn reach(&self) -> Reach {
        match self.plant_elsewhere {
            true => Reach::Anywhere,
            false => Reach::Here,
        }
    }

    /// A plant that the command line names.
    pub(super) fn open(&self, plant: &Path, library: &Library) -> Result<Controlled> {
        Ok(Controlled::open(plant, None, library, self.reach())?)
    }
}

/// The plant of a configuration, or another.
#[derive(Debug, Args)]
pub(super) struct InItsPlace {
    /// Plant instead of the configuration's: a plant file, the name of a built-in one, or a plant in another process,
    /// exec:COMMAND or tcp:HOST:PORT
    #[arg(long, value_name = "NAME")]
    pub plant: Option<PathBuf>,
    #[command(flatten)]
    pub elsewhere: Elsewhere,
}

impl InItsPlace {
    /// Put this plant into a configuration, which would look for a file beside its own.
    pub(super) fn put_into(&self, config: &mut Config) {
        if let Some(plant) = &self.plant {
            config.plant = match plant.is_file() {
                true => std::path::absolute(plant).unwrap_or_else(|_| plant.clone()),
                false => plant.clone(),
            };
        }
    }
}
