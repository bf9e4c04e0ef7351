//! `--shard`: a share of a command's work, in a folder of its own.

use std::fs;

use anyhow::{Context, Result};
use clap::Args;
use serde_json::json;

use super::{Answer, Common, LIBRARY};
use residyn_io::files::content_id;
use residyn_io::runs::{Identity, Part, RunFolder, Shard};

/// The share of the work that a command is to do.
#[derive(Debug, Args)]
pub(super) struct Sharding {
    /// Do only the K-th of N shares of the work, in a folder of its own (--out); `residyn merge` puts the folders together
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
}

impl Sharding {
    /// The part of `run` that is asked for, which `folder` now holds; none if the whole run is asked for.
    pub fn part(&self, folder: &RunFolder, run: Identity) -> Result<Option<Part>> {
        let begin = |shard| Ok(Part::begin(folder, shard, run, program_id()?)?);
        self.shard.map(begin).transpose()
    }
}

/// The shard of a part, or else of a whole run.
pub(super) fn of(part: Option<&Part>) -> Shard {
    part.map_or(Shard::WHOLE, Part::shard)
}

/// Say that all work of a part is done.
pub(super) fn finish(part: Part, common: &Common) -> Result<Answer> {
    let (shard, folder) = (part.shard(), part.folder().clone());
    part.finish()?;
    let out = folder.path();
    let value = || json!({"schema": 1, "shard": shard.to_string(), "out": out});
    let text = format!("shard {shard} is done: {}\n", out.display());
    common.answer(value, out.display(), &text)?;
    Ok(Answer::Yes)
}

/// Hash of this build of the program.
pub(super) fn program_id() -> Result<String> {
    let file = match LIBRARY.get() {
        Some(library) => library.clone(),
        None => std::env::current_exe()?,
    };
    let program = fs::read(file).context("the program cannot read itself")?;
    Ok(content_id(&program))
}
