use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use super::{Answer, Common, inputs};
use crate::data::{Audit, audit};
use crate::model::Library;

/// Audit logs: units, signs, sampling, noise, jumps, lags, excitation, what they cannot show, and what mends them
#[derive(Debug, Args)]
#[command(
    after_help = "Exit status 1 where a finding is serious.\n\nExample:\n  residyn audit --model pendulum run1.csv run2.csv"
)]
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
    let audits = logs.iter().map(|log| audit(log, &model.columns));
    let audits: Vec<Audit> = audits.collect();
    if arguments.common.json {
        inputs::print(&(serde_json::to_string_pretty(&audits)? + "\n"))?;
    } else {
        for audit in &audits {
            inputs::print(&format!("{audit}\n"))?;
        }
    }
    let serious = audits.iter().any(|audit| audit.serious().next().is_some());
    Ok(if serious { Answer::No } else { Answer::Yes })
}
