use std::fmt::Write;
use std::path::Path;

use anyhow::Result;
use clap::{Args, ValueEnum};
use serde_json::json;

use super::{Answer, Common, inputs, terminal};
use residyn_control::control::Task;
use residyn_core::model::{Effect, Library, Model};
use residyn_core::plant::Plant;
use residyn_formats::FORMATS;
use residyn_io::read_plant;

/// List systems, effects, drives, plants, tasks or formats
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  residyn list effects")]
pub(super) struct Arguments {
    what: What,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum What {
    Systems,
    Effects,
    Drives,
    Plants,
    Tasks,
    Formats,
}

/// Formats of the program's own files and of logs.
const OTHERS: &[(&str, &str)] = &[
    (
        "csv",
        "logs, out; in with any separator, decimal commas, and packed with gzip",
    ),
    ("npz", "logs of NumPy, in"),
    ("mat", "logs of MATLAB, versions 5 to 7, in"),
    (
        "mcap",
        "recordings of robots, joint states in CDR or JSON, in",
    ),
    (
        "rosbag2",
        "recordings of ROS 2 as .db3 files and folders, in",
    ),
    ("parquet", "logs, and data sets of LeRobot, in"),
    (
        "toml",
        "models, effects, plants, tasks and recipes, in; fitted models, out",
    ),
    ("html", "reports for a browser, out"),
    ("markdown", "reports, out"),
    ("svg", "plots, out"),
    ("jsonl", "rounds of the learning loop, in and out"),
];

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let library = arguments.effects.library()?;
    let (text, value) = match arguments.what {
        What::Systems => systems(&library)?,
        What::Effects => effects(library.effects()),
        What::Drives => drives(),
        What::Plants => plants(&library)?,
        What::Tasks => tasks()?,
        What::Formats => formats(),
    };
    match arguments.common.json {
        true => terminal::json(&value)?,
        false => terminal::print(&text)?,
    }
    Ok(Answer::Yes)
}

fn systems(library: &Library) -> Result<(String, serde_json::Value)> {
    let (mut text, mut values) = (String::new(), Vec::new());
    for name in Library::system_names() {
        let model: Model = library.model(&name)?;
        let parameters: Vec<&str> = model.parameters.iter().map(|p| p.name.as_str()).collect();
        let _ = writeln!(
            text,
            "{name}: {}\n    parameters: {}",
            model.about,
            parameters.join(", ")
        );
        values.push(json!({"name": name, "about": model.about, "joints": model.joints, "parameters": parameters}));
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
        let parameter = |p: &residyn_core::model::EffectParameter| json!({"name": p.name, "unit": p.unit, "about": p.about, "typical": p.typical});
        values.push(json!({
            "name": effect.name, "about": effect.about, "formula": formula,
            "parameters": effect.parameters.iter().map(parameter).collect::<Vec<_>>(),
            "contains": effect.contains, "confused_with": effect.confused_with, "shown_by": effect.shown_by,
        }));
    }
    (text, values.into())
}

fn drives() -> (String, serde_json::Value) {
    let (mut text, mut values) = (String::new(), Vec::new());
    for drive in Library::drives() {
        let _ = writeln!(
            text,
            "{}: {}\n    {}",
            drive.name,
            drive.about,
            drive.text()
        );
        for [name, unit, about] in drive.parameters() {
            let _ = writeln!(text, "    {name} [{unit}] {about}");
        }
        let parameter =
            |[name, unit, about]: [&str; 3]| json!({"name": name, "unit": unit, "about": about});
        let parameters: Vec<_> = drive.parameters().map(parameter).collect();
        values.push(json!({"name": drive.name, "about": drive.about, "torque": drive.text(), "parameters": parameters}));
    }
    (text, values.into())
}

fn plants(library: &Library) -> Result<(String, serde_json::Value)> {
    let (mut text, mut values) = (String::new(), Vec::new());
    for name in Plant::names() {
        let plant = read_plant(Path::new(name), library)?;
        let effects: Vec<String> = (plant.effects.iter())
            .map(|e| format!("{} on joint {}", e.effect.name, e.joint))
            .collect();
        let with = if effects.is_empty() {
            "no effects".to_owned()
        } else {
            effects.join(", ")
        };
        let _ = writeln!(text, "{name}: {} with {with}", plant.system.name);
        values.push(json!({"name": name, "system": plant.system.name, "effects": effects}));
    }
    Ok((text, values.into()))
}

fn tasks() -> Result<(String, serde_json::Value)> {
    let (mut text, mut values) = (String::new(), Vec::new());
    for name in Task::names() {
        let task = Task::read(Path::new(name))?;
        let _ = writeln!(
            text,
            "{name}: {}\n    maximises {}",
            task.about, task.objective
        );
        values.push(json!({"name": name, "system": task.system, "about": task.about, "objective": task.objective}));
    }
    Ok((text, values.into()))
}

fn formats() -> (String, serde_json::Value) {
    let models = FORMATS.iter().map(|format| {
        let read = format.robots.as_ref();
        let read = read.map_or_else(String::new, |robots| format!("; {}, in", robots.about));
        (format.name, format!("{}, out{read}", format.about))
    });
    let others = OTHERS
        .iter()
        .map(|(name, what)| (*name, (*what).to_owned()));
    let all: Vec<_> = models.chain(others).collect();
    let text = all.iter().map(|(name, what)| format!("{name}: {what}\n"));
    let values = all
        .iter()
        .map(|(name, what)| json!({"name": name, "about": what}));
    (text.collect(), values.collect())
}
