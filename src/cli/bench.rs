mod rigs;

use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand};
use indicatif::ProgressBar;
use serde_json::json;

use super::call::{Begun, files};
use super::shard::{self, Sharding, program_id};
use super::{Answer, Common, message, progress, terminal};
use residyn_core::model::Library;
use residyn_io::files::content_id;
use residyn_io::runs::{Identity, Lines, RunFolder};
use residyn_report::ResultsPage;
use residyn_validation::{Cell, Line, Source, markdown, read, recorded, summarise};

/// Measure the program on simulated and on measured rigs
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Effects(Effects),
    Rigs(rigs::Rigs),
}

/// Measure how often closing the loop names hidden effects, on a grid of rigs coded independently of the models
///
/// Each cell is one line of DIR/cells.jsonl; an interrupted run is resumed. DIR/report.html, DIR/table.md and DIR/summary.json
/// say how often the answer was right.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  residyn bench effects --only pendulum/coulomb --out bench-effects"
)]
struct Effects {
    /// Grid file; the full one has hundreds of cells and takes hours
    #[arg(
        long,
        default_value = "configs/bench/effects.toml",
        value_name = "FILE"
    )]
    grid: PathBuf,
    /// Logs that another program recorded (scripts/mujoco-logs, say) instead of the grid's own rigs
    #[arg(long, value_name = "DIR")]
    logs: Option<PathBuf>,
    /// Folder of the results
    #[arg(long, default_value = "bench-effects", value_name = "DIR")]
    out: PathBuf,
    /// Only cells whose name contains one of these: PLANT/EFFECT@JOINT(SIZES)/CONDITION/SEED
    #[arg(long, num_args = 1.., value_name = "TEXT")]
    only: Vec<String>,
    #[command(flatten)]
    sharding: Sharding,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    match &arguments.what {
        What::Effects(arguments) => effects(arguments),
        What::Rigs(arguments) => rigs::run(arguments),
    }
}

fn effects(arguments: &Effects) -> Result<Answer> {
    let begun = Begun::now();
    let cells = wanted(arguments)?;
    let folder = RunFolder::open(&arguments.out)?;
    folder.make()?;
    let part = arguments.sharding.part(&folder, identity(&cells)?)?;
    let cells: Vec<Cell> = shard::of(part.as_ref()).share(cells).collect();
    let lines = close_all(&cells, &folder)?;
    if let Some(part) = part {
        return shard::finish(part, &arguments.common);
    }
    let summary = summarise(&lines);
    let text = markdown(&summary);
    let json = serde_json::to_string_pretty(&summary)? + "\n";
    folder.write_text("summary.json", &json)?;
    folder.write_text("table.md", &text)?;
    let page = ResultsPage {
        what: "bench effects",
        headline: &summary.headline(),
        text: &text,
        shares: summary.shares(),
        figure: None,
        seed: None,
        configuration: &json!({
            "grid": arguments.grid,
            "logs": arguments.logs,
            "only": arguments.only,
            "cells": cells.iter().map(|cell| &cell.id).collect::<Vec<_>>(),
        }),
        call: &begun.call(&files("grid", std::slice::from_ref(&arguments.grid))?),
    };
    page.write(&folder)?;
    terminal::print(if arguments.common.json { &json } else { &text })?;
    Ok(Answer::Yes)
}

fn wanted(arguments: &Effects) -> Result<Vec<Cell>> {
    let mut all = match &arguments.logs {
        Some(folder) => recorded(folder, &arguments.grid)?,
        None => read(&arguments.grid)?,
    };
    let only = &arguments.only;
    all.retain(|cell| only.is_empty() || only.iter().any(|text| cell.id.contains(text)));
    if all.is_empty() {
        bail!("no cell's name contains what --only asks for");
    }
    Ok(all)
}

/// What decides the results of all cells, kept short: each of a thousand parts stores it.
fn identity(cells: &[Cell]) -> Result<Identity> {
    let each: Vec<String> = cells.iter().map(configuration).collect::<Result<_>>()?;
    let all = content_id(each.concat().as_bytes());
    Ok(Identity {
        command: "bench effects".to_owned(),
        seed: 0,
        config: json!({"cells": cells.len()}),
        inputs: [("what the grid says of the cells".to_owned(), all)].into(),
    })
}

/// Results of all cells; stored ones are not computed again.
fn close_all(cells: &[Cell], folder: &RunFolder) -> Result<Vec<Line>> {
    let program = program_id()?;
    let key = |line: &Line| line.configuration.clone() + &line.program;
    let mut store = Lines::open(folder, "cells.jsonl", key)?;
    let library = Library::built_in();
    let close = |cell: &Cell, bar: &ProgressBar| {
        bar.set_message(cell.id.clone());
        let configuration = configuration(cell)?;
        let key = configuration.clone() + &program;
        let line = store.find_or_make(&key, || -> Result<_> {
            Ok(line(cell, configuration, &program, &library))
        })?;
        Ok(line.clone())
    };
    terminal::stage("closing the loops", || {
        progress::each(folder, "cells", cells, close)
    })
}

fn line(cell: &Cell, configuration: String, program: &str, library: &Library) -> Line {
    let begun = Instant::now();
    let mut settled = cell.clone();
    let findings = unless_panic(|| {
        settled = cell.settled(library)?;
        settled.run(library)
    });
    Line {
        configuration,
        program: program.to_owned(),
        seconds: begun.elapsed().as_secs_f64(),
        cell: settled,
        findings: findings.and_then(|findings| findings.map_err(|error| message(&error))),
    }
}

/// The result of some work, or that it panicked: a panic is a result of the bench, and the run continues.
fn unless_panic<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
    done.map_err(|_| "the program panicked".to_owned())
}

/// Hash of the cell and of the files it uses, which may change while the grid does not.
fn configuration(cell: &Cell) -> Result<String> {
    let mut bytes = serde_json::to_vec(cell)?;
    if cell.model.is_file() {
        bytes.extend(fs::read(&cell.model)?);
    }
    if let Source::Files { logs, .. } = &cell.source {
        for log in logs {
            bytes.extend(fs::read(log).with_context(|| log.display().to_string())?);
        }
    }
    Ok(content_id(&bytes))
}
