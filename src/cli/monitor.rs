use std::fs::{File, read_to_string};
use std::io::{BufRead, BufReader, Read, stdin};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use clap::Args;
use serde_json::{Map, Value};

use super::{Answer, Common, inputs, terminal};
use residyn_core::data::Log;
use residyn_core::model::Model;
use residyn_io::{read_log_from, read_model};
use residyn_monitor::{Alarm, Monitor, Rows, Settings};

/// Watch a running machine: rows as they come, and what has changed against the model, since when
#[derive(Debug, Args)]
#[command(
    after_help = "Exit status 1 if something has changed.\n\nExample:\n  rig-logger | residyn monitor --model reports/arm/model.toml -"
)]
pub(super) struct Arguments {
    /// Model file, fitted to the machine when it was well
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Report of that fit: the intervals of its parameters, where the model file has none
    #[arg(long, value_name = "report.json")]
    report: Option<PathBuf>,
    /// False alarms per hour, over everything that is watched
    #[arg(long, default_value_t = Settings::default().false_alarms_per_hour, value_name = "PER-HOUR")]
    rate: f64,
    /// Length of the first stretch, in which the machine is well, in s
    #[arg(long, default_value_t = Settings::default().healthy_s, value_name = "S")]
    healthy: f64,
    /// Wait for rows that are still to be written, until Ctrl-C
    #[arg(long)]
    follow: bool,
    /// CSV with a header, or one JSON object a line; `-` for standard input
    #[arg(default_value = "-", value_name = "LOG")]
    log: PathBuf,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

/// Lines that are read before they are looked at, unless there are no more for now.
const BATCH: usize = 200;
/// How long to wait for a log to grow.
const AGAIN: Duration = Duration::from_millis(200);

static ENDED: AtomicBool = AtomicBool::new(false);

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let mut model = read_model(&arguments.model, &arguments.effects.library()?)?;
    if let Some(report) = &arguments.report {
        take_intervals(&mut model, report)?;
    }
    let settings = Settings {
        false_alarms_per_hour: arguments.rate,
        healthy_s: arguments.healthy,
        ..Settings::default()
    };
    let mut monitor = Monitor::new(&model, settings)?;
    if arguments.follow {
        // Without a handler Ctrl-C ends the program all the same, without a summary.
        _ = ctrlc::set_handler(|| ENDED.store(true, Ordering::SeqCst));
    }
    let mut lines = Lines::open(&arguments.log, arguments.follow)?;
    let mut header = None;
    let mut read = 0;
    while let Some(batch) = lines.next(BATCH)? {
        let from = read + 1;
        read += batch.len();
        let place = || format!("{}, lines {from} to {read}", arguments.log.display());
        let rows = rows(&model, &mut header, &batch).with_context(place)?;
        for alarm in monitor.update(&rows).with_context(place)? {
            print(&alarm, arguments.common.json)?;
        }
    }
    let summary = monitor.summary();
    if !summary.is_calibrated {
        bail!(
            "{} ends after {} row(s), before the healthy stretch of {} s does; record more, or shorten it with --healthy",
            arguments.log.display(),
            summary.rows,
            arguments.healthy
        );
    }
    match arguments.common.json {
        true => line(&summary)?,
        false => terminal::answer(
            format!("{} alarm(s)", summary.alarms.len()),
            &summary.to_string(),
        )?,
    }
    Ok(Answer::of(summary.alarms.is_empty()))
}

fn print(alarm: &Alarm, as_json: bool) -> Result<()> {
    match as_json {
        true => line(alarm),
        false => terminal::print(&format!("{:.1} s: {alarm}\n", alarm.time_s)),
    }
}

/// One line of JSON.
fn line(value: &impl serde::Serialize) -> Result<()> {
    terminal::print(&(serde_json::to_string(value)? + "\n"))
}

/// Lines of a log that may still grow.
struct Lines {
    reader: BufReader<Box<dyn Read>>,
    follows: bool,
    /// A line whose end has not come yet.
    begun: String,
}

impl Lines {
    fn open(path: &Path, follows: bool) -> Result<Self> {
        let reader: Box<dyn Read> = match path.as_os_str() == "-" {
            true => Box::new(stdin()),
            false => {
                let file = File::open(path)
                    .with_context(|| format!("{}: cannot be read", path.display()))?;
                Box::new(file)
            }
        };
        Ok(Self {
            reader: BufReader::new(reader),
            follows,
            begun: String::new(),
        })
    }

    /// The next lines, at most `most` and at least three unless the log ends: what is there is not kept waiting for more. `None`
    /// at its end.
    fn next(&mut self, most: usize) -> Result<Option<Vec<String>>> {
        let mut lines = Vec::new();
        while lines.len() < most {
            let count = self.reader.read_line(&mut self.begun)?;
            if self.begun.ends_with('\n') || count == 0 && !self.follows && !self.begun.is_empty() {
                let whole = std::mem::take(&mut self.begun);
                if !whole.trim().is_empty() {
                    lines.push(whole.trim_end().to_owned());
                }
                if lines.len() > 2 && self.reader.buffer().is_empty() {
                    break;
                }
                continue;
            }
            if count > 0 {
                continue;
            }
            let is_over = !self.follows || ENDED.load(Ordering::SeqCst);
            if is_over || lines.len() > 2 {
                break;
            }
            sleep(AGAIN);
        }
        Ok((!lines.is_empty()).then_some(lines))
    }
}

/// The rows of some lines. The first line of a CSV is kept as the header of all others.
fn rows(model: &Model, header: &mut Option<String>, lines: &[String]) -> Result<Rows> {
    let log = match lines[0].trim_start().starts_with('{') {
        true => of_objects(model, lines)?,
        false => {
            let first = header.is_none();
            let header = header.get_or_insert_with(|| lines[0].clone());
            let rows = &lines[usize::from(first)..];
            if rows.is_empty() {
                return Ok(Rows::none(model.joints, model.measured.len()));
            }
            let text = std::iter::once(header.as_str()).chain(rows.iter().map(String::as_str));
            let text = text.collect::<Vec<_>>().join("\n") + "\n";
            read_log_from(text.as_bytes(), "rows", model)?
        }
    };
    Ok(Rows::of_log(&log, model.measured_names())?)
}

/// Rows as JSON: each column a number, or `"q": [0.1, 0.2]` for those of all joints.
fn of_objects(model: &Model, lines: &[String]) -> Result<Log> {
    let mut columns: Vec<(String, Vec<f64>)> = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let object: Map<String, Value> = serde_json::from_str(line)
            .with_context(|| format!("line {} of these is not a JSON object", at + 1))?;
        let numbers = object.iter().flat_map(|(name, value)| match value {
            Value::Array(of_joints) => {
                let numbered = of_joints.iter().enumerate();
                numbered
                    .map(|(joint, value)| (format!("{name}{}", joint + 1), value))
                    .collect()
            }
            value => vec![(name.clone(), value)],
        });
        for (name, value) in numbers {
            // What is no number is told by the log, with its row and column.
            let value = value.as_f64().unwrap_or(f64::NAN);
            match columns.iter_mut().find(|(own, _)| *own == name) {
                Some((_, column)) => column.push(value),
                None if at == 0 => columns.push((name, vec![value])),
                None => bail!(
                    "line {} of these has `{name}`, which the first one lacks",
                    at + 1
                ),
            }
        }
    }
    Ok(model.log_from_columns("rows", columns)?)
}

/// Intervals of the declared parameters that the model file does not have.
fn take_intervals(model: &mut Model, path: &Path) -> Result<()> {
    let text =
        read_to_string(path).with_context(|| format!("{}: cannot be read", path.display()))?;
    let report: Value = serde_json::from_str(&text)
        .with_context(|| format!("{}: is not a report", path.display()))?;
    let Some(found) = report["parameters"].as_array() else {
        bail!(
            "{}: has no `parameters`; give the report.json of closeloop",
            path.display()
        );
    };
    for parameter in &mut model.parameters {
        let own = found
            .iter()
            .find(|own| own["name"] == parameter.name.as_str());
        let ends = own.map(|own| [0, 1].map(|end| own["ci95"][end].as_f64()));
        if let (None, Some([Some(low), Some(high)])) = (parameter.ci95, ends) {
            parameter.ci95 = Some([low, high]);
        }
    }
    Ok(())
}
