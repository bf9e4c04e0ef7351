use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use super::{Answer, Common, inputs};
use crate::data::{Audit, audit};
use crate::model::Library;

/// Audit logs: sampling, noise, spikes, lags, excitation, and what they cannot show
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  residyn audit --model pendulum run1.csv run2.csv")]
pub(super) struct Arguments {
    /// Model file, or the name of a built-in system: number of joints and names of columns
    #[arg(long)]
    model: PathBuf,
    /// Logs to audit
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let model = Library::built_in().model(&arguments.model)?;
    let logs = inputs::logs(&arguments.logs, &model)?;
    inputs::print_notes(&logs);
    let audits: Vec<Audit> = logs.iter().map(audit).collect();
    if arguments.common.json {
        inputs::print(&(serde_json::to_string_pretty(&audits)? + "\n"))?;
    } else {
        for audit in &audits {
            inputs::print(&format!("{audit}\n"))?;
        }
    }
    Ok(Answer::Yes)
}
