use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use serde_json::json;

use super::{Answer, Common, inputs};
use crate::formats::{read_mjcf, read_urdf};
use crate::model::chain::{Chain, model_text};
use crate::model::{Library, System};
use crate::report::write_whole;

/// Write a model file for a serial mechanism, its equations derived from a robot description
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  residyn new --from-urdf arm.urdf --out arm.toml")]
pub(super) struct Arguments {
    #[command(flatten)]
    description: Description,
    /// The model file to write; standard output if not given
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Description {
    /// URDF of up to three revolute, continuous or prismatic joints, one carrying the next
    #[arg(long, value_name = "FILE")]
    from_urdf: Option<PathBuf>,
    /// MJCF of up to three hinge or slide joints, one carrying the next
    #[arg(long, value_name = "FILE")]
    from_mjcf: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let chain = chain(&arguments.description)?;
    let text = model_text(&chain);
    let name = Path::new(&chain.name);
    let system = System::from_text(name, &text, Library::built_in().effects())?;
    for note in &chain.notes {
        eprintln!("note: {note}");
    }
    if let Some(out) = &arguments.out {
        write_whole(out, text.as_bytes())?;
    }
    if arguments.common.json {
        let value = json!({"model": text, "joints": system.joints, "notes": chain.notes, "out": arguments.out});
        inputs::print(&format!("{value:#}\n"))?;
    } else if let Some(out) = &arguments.out {
        inputs::print(&format!(
            "{}: model of {}, joints: {}\n",
            out.display(),
            system.name,
            system.joints
        ))?;
    } else {
        inputs::print(&text)?;
    }
    Ok(Answer::Yes)
}

fn chain(description: &Description) -> Result<Chain> {
    match (&description.from_urdf, &description.from_mjcf) {
        (Some(urdf), _) => Ok(read_urdf(urdf)?),
        (None, Some(mjcf)) => Ok(read_mjcf(mjcf)?),
        (None, None) => anyhow::bail!("give --from-urdf or --from-mjcf"),
    }
}
