use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::{Args, ValueEnum};
use serde_json::json;

use super::{Answer, Common, inputs};
use crate::model::{Effect, Library, System};

/// What there is: systems, effects or formats
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  residyn list effects")]
pub(super) struct Arguments {
    what: What,
    /// Folders of your own effect files
    #[arg(long, num_args = 1.., value_name = "DIR")]
    effects: Vec<PathBuf>,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum What {
    Systems,
    Effects,
    Formats,
}

/// Formats that the program reads and writes, and what for.
const FORMATS: &[(&str, &str)] = &[
    ("csv", "logs, in and out"),
    (
        "toml",
        "models, effects, plants and recipes, in; fitted models, out",
    ),
    ("safetensors", "weights of checkpoints, in and out"),
    ("json", "reports and results, out"),
    ("markdown", "reports, out"),
    ("svg", "plots, out"),
];

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let library = inputs::library(&arguments.effects)?;
    let (text, value) = match arguments.what {
        What::Systems => systems(&library)?,
        What::Effects => effects(library.effects()),
        What::Formats => formats(),
    };
    let json = serde_json::to_string_pretty(&value)? + "\n";
    inputs::print(if arguments.common.json { &json } else { &text })?;
    Ok(Answer::Yes)
}

fn systems(library: &Library) -> Result<(String, serde_json::Value)> {
    let (mut text, mut values) = (String::new(), Vec::new());
    for name in Library::system_names() {
        let system: System = library.system(Path::new(&name))?;
        let parameters: Vec<&str> = system.parameters.iter().map(|p| p.name.as_str()).collect();
        let _ = writeln!(
            text,
            "{name}: {}\n    parameters: {}",
            system.about,
            parameters.join(", ")
        );
        values.push(json!({"name": name, "about": system.about, "joints": system.joints, "parameters": parameters}));
    }
    Ok((text, values.into()))
}

fn effects(effects: &[Effect]) -> (String, serde_json::Value) {
    let (mut text, mut values) = (String::new(), Vec::new());
    for effect in effects {
        let formula = effect.text();
        let _ = writeln!(text, "{}: {}\n    {formula}", effect.name, effect.about);
        for p in &effect.parameters {
            let _ = writeln!(
                text,
                "    {} [{}] {}; usually about {}",
                p.name, p.unit, p.about, p.typical
            );
        }
        let _ = writeln!(text, "    shown by {}", effect.shown_by);
        let parameter = |p: &crate::model::EffectParameter| json!({"name": p.name, "unit": p.unit, "about": p.about, "typical": p.typical});
        values.push(json!({
            "name": effect.name, "about": effect.about, "formula": formula,
            "parameters": effect.parameters.iter().map(parameter).collect::<Vec<_>>(),
            "contains": effect.contains, "confused_with": effect.confused_with, "shown_by": effect.shown_by,
        }));
    }
    (text, values.into())
}

fn formats() -> (String, serde_json::Value) {
    let text = FORMATS
        .iter()
        .map(|(name, what)| format!("{name}: {what}\n"))
        .collect();
    let values: Vec<_> = FORMATS
        .iter()
        .map(|(name, what)| json!({"name": name, "about": what}))
        .collect();
    (text, values.into())
}
