use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, CommandFactory};
use clap_complete::{Shell, generate};

use super::{Answer, Cli, terminal};
use residyn_io::files::OutputError;

/// Completions for a shell, on standard output
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  residyn completions bash > ~/.local/share/bash-completion/completions/residyn"
)]
pub(super) struct Completions {
    shell: Shell,
}

/// Manual pages, one per command
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  residyn man ~/.local/share/man/man1")]
pub(super) struct Man {
    /// Folder to write them into; it is created if missing
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub(super) fn completions(arguments: &Completions) -> Result<Answer> {
    let mut out = Vec::new();
    generate(arguments.shell, &mut Cli::command(), "residyn", &mut out);
    terminal::print(&String::from_utf8_lossy(&out))?;
    Ok(Answer::Yes)
}

pub(super) fn man(arguments: &Man) -> Result<Answer> {
    let folder = &arguments.folder;
    std::fs::create_dir_all(folder).map_err(OutputError::of(folder))?;
    clap_mangen::generate_to(Cli::command(), folder).map_err(OutputError::of(folder))?;
    Ok(Answer::Yes)
}
