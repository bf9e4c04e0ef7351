use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use super::fitting::{Saving, carry_out};
use super::{Answer, Common, command_line, inputs, terminal};
use residyn_train::recipe::{Job, Recipe};

/// Train a hybrid, physics-only or data-driven model from scratch, on logs or on a simulated plant
///
/// The same command resumes a run that was interrupted, and ends with the same numbers.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  residyn train --config configs/train-pendulum.toml --out pendulum --seed 1"
)]
pub(super) struct Arguments {
    /// Training recipe
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    saving: Saving,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let Arguments {
        config,
        effects,
        saving,
        common,
    } = arguments;
    let library = effects.library()?;
    let recipe = Recipe::read(config)?;
    let prepare = || Job::train(recipe, &library, common.device, common.seed);
    let job = terminal::stage("preparing the data", prepare)?;
    let dir = saving.folder(config, "checkpoint");
    carry_out(&job.begun_by(command_line()), &dir, saving, common)
}
