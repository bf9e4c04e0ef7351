use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use super::fitting::{Saving, carry_out};
use super::{Answer, Common, command_line, inputs};
use residyn_train::Checkpoint;
use residyn_train::recipe::{Job, Recipe};

/// Fine-tune a saved checkpoint on new data (sim-to-real)
///
/// All parameters of the checkpoint's model are trained further. If it has no residual network, one is added that is
/// initially zero, unless the recipe's `kind` says otherwise.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  residyn tune --checkpoint pendulum --train run1.csv run2.csv --out tuned\n  \
                  residyn tune --checkpoint pendulum --config configs/tune-pendulum.toml --out tuned"
)]
pub(super) struct Arguments {
    /// Checkpoint to start from; it is not changed
    #[arg(long, value_name = "DIR")]
    checkpoint: PathBuf,
    /// Training recipe, without [start] and hold
    #[arg(long, value_name = "FILE", required_unless_present = "train")]
    config: Option<PathBuf>,
    /// Logs to train on, with the default settings
    #[arg(long, num_args = 1.., value_name = "LOG", conflicts_with = "config")]
    train: Vec<PathBuf>,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    saving: Saving,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let Arguments {
        checkpoint: from,
        config,
        train,
        effects,
        saving,
        common,
    } = arguments;
    let library = effects.library()?;
    let checkpoint = Checkpoint::load(from)?;
    let job = match config {
        Some(config) => {
            let recipe = Recipe::read(config)?;
            Job::tune(&checkpoint, recipe, &library, common.device, common.seed)?
        }
        None => {
            let logs = train.clone();
            Job::tune_on_logs(&checkpoint, logs, &library, common.device, common.seed)?
        }
    };
    let dir = saving.folder(from, "tuned");
    carry_out(&job.begun_by(command_line()), &dir, saving, common)
}
