use residyn_io::read_model;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use serde_json::json;

use super::{Answer, Common, inputs, terminal};

/// Check model files: unused parameters and inputs, mass matrix, units, misleading names
#[derive(Debug, Args)]
#[command(
    after_help = "Exit status 1 if something is found, 2 if a file cannot be read.\n\nExample:\n  residyn check arm.toml"
)]
pub(super) struct Arguments {
    /// Model files, or names of built-in systems
    #[arg(required = true, value_name = "MODEL")]
    models: Vec<PathBuf>,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let library = arguments.effects.library()?;
    let models = arguments
        .models
        .iter()
        .map(|path| read_model(path, &library));
    let models = models.collect::<Result<Vec<_>, _>>()?;
    let mut rng = residyn_core::rng(arguments.common.seed);
    let checks: Vec<_> = models.iter().map(|model| model.check(&mut rng)).collect();
    let named = || arguments.models.iter().zip(&checks);
    if arguments.common.json {
        let values = named().map(|(path, check)| {
            let mut value = json!(check);
            value["model"] = json!(path);
            value
        });
        let values: Vec<_> = values.collect();
        terminal::json(&values)?;
    } else {
        for (path, check) in named() {
            let path = path.display();
            let headline = format!("{path}: {} finding(s)", check.findings.len());
            terminal::answer(headline, &format!("{path}: {check}\n"))?;
        }
    }
    let is_clean = checks.iter().all(|check| check.findings.is_empty());
    Ok(Answer::of(is_clean))
}
