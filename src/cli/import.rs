use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use serde_json::json;

use super::{Answer, Common, inputs};
use crate::save_imported;
use residyn_formats::Imported;
use residyn_io::runs::RunFolder;

/// Make a checkpoint from a model that was exported as JSON and safetensors
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  residyn import --file pendulum.json --out pendulum")]
pub(super) struct Arguments {
    /// The JSON file; the weights that it names are next to it
    #[arg(long, value_name = "JSON")]
    file: PathBuf,
    /// Folder of the checkpoint
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let library = arguments.effects.library()?;
    let Common { seed, device, .. } = arguments.common;
    let imported = Imported::read(&arguments.file, library.effects())?;
    let (system, by) = (
        imported.system.name.clone(),
        imported.written_by().to_owned(),
    );
    let _folder = RunFolder::open(&arguments.out)?;
    save_imported(&arguments.out, imported, seed, device)?;
    let out = arguments.out.display();
    let value = || json!({"system": system, "written_by": by, "checkpoint": arguments.out});
    let line = format!("{out}: checkpoint of a model of {system}, exported by version {by}");
    (arguments.common).answer(value, &line, &format!("{line}\n"))?;
    Ok(Answer::Yes)
}
