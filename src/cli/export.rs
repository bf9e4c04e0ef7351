use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use serde::Deserialize;
use serde_json::{Value, json};

use super::inputs::{self, Source};
use super::{Answer, Common, terminal};
use crate::exported_task;
use residyn_core::limits::SUBSTEPS;
use residyn_core::model::Library;
use residyn_core::rng;
use residyn_core::sim::Integrator;
use residyn_formats::{
    Client, ClientError, Difference, ExportModel, File, Format, WrittenBack, find, rollout_s,
    write_back,
};
use residyn_io::files::{OutputError, folder_of, read_text, write_whole};
use residyn_io::read_model;
use residyn_train::{Checkpoint, Manifest};

/// Write a model for other programs, and compare their predictions with its own
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    residyn export --checkpoint closeloop-report/checkpoint --format onnx --out pendulum.onnx\n  \
    residyn export --model closeloop-report/model.toml --format c --out pendulum.h --step 0.001\n  \
    residyn export --model report/model.toml --ranges report/ranges.json --format isaaclab --out robot.py\n  \
    residyn export --model report/model.toml --into arm.urdf --out arm-fitted.urdf")]
pub(super) struct Arguments {
    #[command(flatten)]
    model: inputs::ModelArguments,
    /// Format; `residyn list formats` shows all
    #[arg(long, value_parser = find, required_unless_present = "into")]
    format: Option<&'static Format>,
    /// Instead of a format: the URDF or MJCF that the model was made from, rewritten with the model's inertias, damping
    /// and friction. Everything else in it stays as it is
    #[arg(long, value_name = "FILE", conflicts_with_all = ["format", "checkpoint", "step", "integrator"])]
    into: Option<PathBuf>,
    /// With --into: the last link, as given to `residyn new`
    #[arg(long, value_name = "LINK", requires = "into")]
    tip: Option<String>,
    /// The ranges.json of a report, whose ranges from run to run replace the intervals in the model: what isaaclab and
    /// mjlab draw
    #[arg(long, value_name = "FILE", requires = "format")]
    ranges: Option<PathBuf>,
    /// Output path
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
    /// How long a torque is held, in s; by default the checkpoint's own, else 0.01
    #[arg(long, value_name = "S")]
    step: Option<f64>,
    /// Integrator: semi_implicit_euler, rk4 or fine:N; by default the checkpoint's own, else rk4
    #[arg(long)]
    integrator: Option<Integrator>,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

/// The default step, in s.
const STEP_S: f64 = 0.01;

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    match (arguments.format, &arguments.into) {
        (Some(format), _) => write(arguments, format),
        (None, Some(file)) => write_into(arguments, file),
        (None, None) => unreachable!("clap asks for one of both"),
    }
}

fn write(arguments: &Arguments, format: &'static Format) -> Result<Answer> {
    let model = portable(arguments)?;
    let task = exported_task(model.name());
    let model = model.with_task(task);
    let model = match &arguments.ranges {
        Some(file) => in_ranges(model, file)?,
        None => model,
    };
    let not_carried = (format.not_carried)(&model);
    if let Some(message) = steps_message(format, &model, arguments)? {
        terminal::say(message);
    }
    prepare(arguments, &not_carried)?;
    let files = terminal::stage("writing", || format.write(&model, &arguments.out))?;
    let compare = || measure(format, &model, arguments);
    let measured = terminal::stage("comparing with a client of the format", compare);
    terminal::print(&match arguments.common.json {
        true => format!("{:#}\n", printed(format, &files, &not_carried, &measured)),
        false => text(format, &files, &not_carried, &measured, model.step_s),
    })?;
    if let Err(ClientError::Failed(said)) = &measured {
        bail!("what was written cannot be read: {said}");
    }
    Ok(match measured {
        Ok(difference) if difference.pointwise() <= format.tolerance => Answer::Yes,
        Err(ClientError::Unavailable(_)) => Answer::Yes,
        _ => Answer::No,
    })
}

/// An entry of `ranges.json`.
#[derive(Deserialize)]
struct Range {
    name: String,
    /// An open end is null.
    range: [Option<f64>; 2],
}

/// The model with the ranges of a file as intervals.
fn in_ranges(model: ExportModel, file: &Path) -> Result<ExportModel> {
    let at_file = || file.display().to_string();
    let text = read_text(file).with_context(at_file)?;
    let ranges: Vec<Range> = serde_json::from_str(&text).with_context(at_file)?;
    let closed = |one: &Range| Some([one.range[0]?, one.range[1]?]);
    let named = ranges
        .iter()
        .filter_map(|one| Some((one.name.as_str(), closed(one)?)));
    let named: Vec<(&str, [f64; 2])> = named.collect();
    let other = |why| anyhow!("{}: of another model: {why}", file.display());
    model.with_intervals(&named).map_err(other)
}

/// What to do if the steps are too long for the friction of a model at rest. Files that nobody can step have none.
fn steps_message(
    format: &Format,
    model: &ExportModel,
    arguments: &Arguments,
) -> Result<Option<String>> {
    if matches!(format.client, Client::None(_)) {
        return Ok(None);
    }
    let mut rng = rng(arguments.common.seed);
    let needed = model.substeps_around_rest(&mut rng)?;
    if needed <= model.integrator.substeps() {
        return Ok(None);
    }
    let remedy = match needed <= SUBSTEPS as usize {
        true => format!(
            "give --integrator fine:{needed}, or a --step of {:.1e} s",
            model.step_s / needed as f64
        ),
        false => {
            "give `smoothing_velocity` in the model file, over which friction reverses".to_owned()
        }
    };
    Ok(Some(format!(
        "note: friction at rest is too steep for steps of {} s, in which the model creeps or chatters; {remedy}",
        model.step_s
    )))
}

/// Rewrite a robot description with the values of a model that was made from it.
fn write_into(arguments: &Arguments, file: &Path) -> Result<Answer> {
    let Source::File(model) = arguments.model.source() else {
        unreachable!("clap refuses a checkpoint beside --into");
    };
    let model = read_model(model, &arguments.effects.library()?)?;
    model.stands_alone("a robot description")?;
    let WrittenBack { text, not_carried } = write_back(&model, file, arguments.tip.as_deref())?;
    prepare(arguments, &not_carried)?;
    write_whole(&arguments.out, text.as_bytes())?;
    let (out, into) = (arguments.out.display(), file.display());
    terminal::print(&match arguments.common.json {
        true => format!(
            "{:#}\n",
            json!({"into": file, "out": arguments.out, "not_carried": not_carried})
        ),
        false => format!("{out}: {into} with the values of {}\n", model.name),
    })?;
    Ok(Answer::Yes)
}

/// Say what is not carried, and make the folder of the output.
fn prepare(arguments: &Arguments, not_carried: &[String]) -> Result<()> {
    for what in not_carried {
        terminal::say(format!("not carried: {what}"));
    }
    let folder = folder_of(&arguments.out);
    Ok(std::fs::create_dir_all(folder).map_err(OutputError::of(folder))?)
}

fn measure(
    format: &Format,
    model: &ExportModel,
    arguments: &Arguments,
) -> Result<Difference, ClientError> {
    // Nobody asks for samples, which take seconds for a rig of many joints.
    if let Client::None(reason) = &format.client {
        return Err(ClientError::Unavailable((*reason).to_owned()));
    }
    let mut rng = rng(arguments.common.seed);
    let refused = |error: residyn_core::model::NetworkError| ClientError::Failed(error.to_string());
    let samples = model.samples(&mut rng).map_err(refused)?;
    let own = model.predict(&samples).map_err(refused)?;
    own.check_finite(&samples)?;
    let (own, lost) = own.without_lost_rollout();
    if let Some(step) = lost {
        terminal::say(format!(
            "note: the rollout is no longer finite in step {} of {:?} s and is not compared",
            step + 1,
            samples.step_s
        ));
    }
    Ok(own.difference(&format.predict(&arguments.out, &samples)?))
}

fn portable(arguments: &Arguments) -> Result<ExportModel> {
    if let Some(step) = arguments.step.filter(|s| !(*s > 0.0 && s.is_finite())) {
        bail!("--step {step}: a step is a number of seconds above zero");
    }
    let library = arguments.effects.library()?;
    let model = match arguments.model.source() {
        Source::Checkpoint(dir) => of_checkpoint(arguments, dir, &library)?,
        Source::File(file) => of_file(arguments, file, &library)?,
    };
    model.check_measured()?;
    Ok(model)
}

fn of_checkpoint(arguments: &Arguments, dir: &Path, library: &Library) -> Result<ExportModel> {
    let device = arguments.common.device;
    let (checkpoint, model, _) = Checkpoint::open(dir, library, device)?;
    let Manifest {
        config,
        seed,
        settings,
        ..
    } = &checkpoint.manifest;
    Ok(ExportModel::new(
        &model,
        checkpoint.weights.clone(),
        arguments.integrator.unwrap_or(settings.integrator),
        arguments.step.or(step_of(config)).unwrap_or(STEP_S),
        json!({"config": config, "seed": seed}),
    ))
}

/// The step (s) of the data that a checkpoint was trained on.
fn step_of(config: &Value) -> Option<f64> {
    let places = ["/recipe/data/step_s", "/step_s"];
    let mut steps = places.iter().map(|place| config.pointer(place));
    steps.find_map(|step| step?.as_f64())
}

fn of_file(arguments: &Arguments, file: &Path, library: &Library) -> Result<ExportModel> {
    let model = read_model(file, library)?;
    Ok(ExportModel::of_system(
        &model,
        arguments.integrator.unwrap_or(Integrator::RK4),
        arguments.step.unwrap_or(STEP_S),
        json!({"config": {"model": file}, "seed": arguments.common.seed}),
    ))
}

fn printed(
    format: &Format,
    files: &[File],
    not_carried: &[String],
    measured: &Result<Difference, ClientError>,
) -> Value {
    let file =
        |file: &File| json!({"path": file.path, "bytes": file.bytes.len(), "about": file.about});
    let difference = match measured {
        Ok(difference) => json!(difference),
        Err(_) => Value::Null,
    };
    json!({
        "format": format.name,
        "files": files.iter().map(file).collect::<Vec<_>>(),
        "not_carried": not_carried,
        "difference": difference,
        "not_measured": measured.as_ref().err().map(ToString::to_string),
    })
}

fn text(
    format: &Format,
    files: &[File],
    not_carried: &[String],
    measured: &Result<Difference, ClientError>,
    step_s: f64,
) -> String {
    let rollout = match rollout_s(step_s) {
        long if long >= 1e-3 => format!("a rollout of {long} s"),
        short => format!("a rollout of {short:e} s"),
    };
    let mut out = String::new();
    for File { path, bytes, about } in files {
        let _ = writeln!(out, "{}: {about}, {}", path.display(), size(bytes.len()));
    }
    match measured {
        Ok(difference) => {
            let parts = [
                ("a step", difference.next),
                ("the derivative", difference.derivative),
                (rollout.as_str(), difference.rollout),
            ];
            let parts = parts.iter().filter_map(|(what, d)| Some((what, (*d)?)));
            let parts: Vec<String> = parts
                .map(|(what, d)| format!("{what} {}", share(d)))
                .collect();
            let _ = writeln!(
                out,
                "largest difference from the program's own prediction, relative to each state's largest value: {}",
                parts.join(", ")
            );
            if difference.pointwise() > format.tolerance {
                let why = match not_carried {
                    [] => "",
                    _ => ": what is not carried shows in it",
                };
                let _ = writeln!(
                    out,
                    "this exceeds the tolerance of {:.0e}{why}",
                    format.tolerance
                );
            }
        }
        // Nothing can be predicted from settings.
        Err(_) if matches!(format.client, Client::None(_)) => {}
        Err(reason) => {
            let _ = writeln!(
                out,
                "difference from the program's own prediction not measured: {reason}"
            );
        }
    }
    out
}

/// To two digits.
fn share(difference: f64) -> String {
    if difference == 0.0 {
        return "0".to_owned();
    }
    format!("{difference:.1e}")
}

fn size(bytes: usize) -> String {
    match bytes {
        0..10_000 => format!("{bytes} bytes"),
        _ => format!("{} kB", bytes.div_ceil(1000)),
    }
}
