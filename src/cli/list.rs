use std::fmt::Write;
use std::path::Path;

use anyhow::Result;
use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::{Answer, Common, inputs, terminal};
use residyn_control::control::Task;
use residyn_core::model::{Effect, EffectParameter, Library, Model, ReadyDrive};
use residyn_core::plant::Plant;
use residyn_formats::FORMATS;
use residyn_io::{LOG_FORMATS, read_plant};

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

/// Formats of the program's own files.
const OTHERS: &[(&str, &str)] = &[
    (
        "toml",
        "models, effects, plants, tasks and recipes, in; fitted models, out",
    ),
    ("html", "reports for a browser, out"),
    ("markdown", "reports, out"),
    ("svg", "plots, out"),
    ("jsonl", "rounds of the learning loop, in and out"),
];

/// What an entry says, as text and in JSON.
type Entry = (String, Value);

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let library = arguments.effects.library()?;
    let entries = match arguments.what {
        What::Systems => systems(&library)?,
        What::Effects => library.effects().iter().map(effect).collect(),
        What::Drives => Library::drives().iter().map(drive).collect(),
        What::Plants => plants(&library)?,
        What::Tasks => tasks()?,
        What::Formats => formats(),
    };
    let (texts, values): (Vec<String>, Vec<Value>) = entries.into_iter().unzip();
    match arguments.common.json {
        true => terminal::json(&values)?,
        false => terminal::print(&texts.concat())?,
    }
    Ok(Answer::Yes)
}

fn systems(library: &Library) -> Result<Vec<Entry>> {
    let system = |name: String| {
        let model: Model = library.model(&name)?;
        let parameters: Vec<&str> = model.parameters.iter().map(|p| p.name.as_str()).collect();
        let (about, list) = (&model.about, parameters.join(", "));
        Ok((
            format!("{name}: {about}\n    parameters: {list}\n"),
            json!({"name": name, "about": about, "joints": model.joints, "parameters": parameters}),
        ))
    };
    Library::system_names().into_iter().map(system).collect()
}

fn effect(effect: &Effect) -> Entry {
    let formula = effect.text();
    let mut text = format!("{}: {}\n    {formula}\n", effect.name, effect.about);
    for p in &effect.parameters {
        let _ = writeln!(
            text,
            "    {} [{}] {}; usually about {}",
            p.name, p.unit, p.about, p.typical
        );
    }
    let _ = writeln!(text, "    shown by {}", effect.shown_by);
    let parameter = |p: &EffectParameter| json!({"name": p.name, "unit": p.unit, "about": p.about, "typical": p.typical});
    let value = json!({
        "name": effect.name, "about": effect.about, "formula": formula,
        "parameters": effect.parameters.iter().map(parameter).collect::<Vec<_>>(),
        "contains": effect.contains, "confused_with": effect.confused_with, "shown_by": effect.shown_by,
    });
    (text, value)
}

fn drive(drive: &ReadyDrive) -> Entry {
    let torque = drive.text();
    let mut text = format!("{}: {}\n    {torque}\n", drive.name, drive.about);
    let mut parameters = Vec::new();
    for [name, unit, about] in drive.parameters() {
        let _ = writeln!(text, "    {name} [{unit}] {about}");
        parameters.push(json!({"name": name, "unit": unit, "about": about}));
    }
    let value = json!({"name": drive.name, "about": drive.about, "torque": torque, "parameters": parameters});
    (text, value)
}

fn plants(library: &Library) -> Result<Vec<Entry>> {
    let plant = |name: &str| {
        let plant = read_plant(Path::new(name), library)?;
        let system = &plant.system.name;
        let effects: Vec<String> = (plant.effects.iter())
            .map(|e| format!("{} on joint {}", e.effect.name, e.joint))
            .collect();
        let with = match effects.as_slice() {
            [] => "no effects".to_owned(),
            effects => effects.join(", "),
        };
        Ok((
            format!("{name}: {system} with {with}\n"),
            json!({"name": name, "system": system, "effects": effects}),
        ))
    };
    Plant::names().into_iter().map(plant).collect()
}

fn tasks() -> Result<Vec<Entry>> {
    let task = |name: &str| {
        let task = Task::read(Path::new(name))?;
        let (about, objective) = (&task.about, &task.objective);
        Ok((
            format!("{name}: {about}\n    maximises {objective}\n"),
            json!({"name": name, "system": task.system, "about": about, "objective": objective}),
        ))
    };
    Task::names().into_iter().map(task).collect()
}

fn formats() -> Vec<Entry> {
    let models = FORMATS.iter().map(|format| {
        let read = format.robots.as_ref();
        let read = read.map_or_else(String::new, |robots| format!("; {}, in", robots.about));
        (format.name, format!("{}, out{read}", format.about))
    });
    let logs = LOG_FORMATS.iter().map(|log| (log.name, log.about));
    let others = logs.chain(OTHERS.iter().copied());
    let all = models.chain(others.map(|(name, about)| (name, about.to_owned())));
    all.map(|(name, about)| {
        (
            format!("{name}: {about}\n"),
            json!({"name": name, "about": about}),
        )
    })
    .collect()
}
