use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use super::{Answer, terminal};
use residyn_io::runs::RunFolder;
use residyn_report::Report;

/// Make report.html and report.md again from report.json
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  residyn report report")]
pub(super) struct Arguments {
    /// Folder that closeloop wrote
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let report = Report::read(&arguments.folder)?;
    let _folder = RunFolder::open(&arguments.folder)?;
    for path in report.write_readable(&arguments.folder)? {
        terminal::print(&format!("{}\n", path.display()))?;
    }
    Ok(Answer::Yes)
}
