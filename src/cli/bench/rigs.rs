use std::collections::BTreeMap;
use std::convert::Infallible;
use std::env;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Args;
use indicatif::ProgressBar;
use serde_json::json;

use super::shard::{self, Sharding, program_id};
use super::{Answer, Common, message, progress, terminal, unless_panic};
use crate::cli::call::{Begun, files};
use residyn_core::model::Library;
use residyn_formats::ClientError;
use residyn_io::runs::{Identity, RunFolder};
use residyn_report::ResultsPage;
use residyn_train::ResidualTrainer;
use residyn_validation::rigs::{
    Fold, Found, Line, Measured, Method, Rig, Tools, markdown, picture, read, summarise,
};

/// Compare closing the loop with a plain structure, published parameters and mujoco.sysid on measured rigs
///
/// Each log in turn is left out of the fit and scored. Results are stored one by one in DIR/RIG/LOG; an interrupted run
/// is resumed, and a later run repeats only what has changed since. DIR/report.html, DIR/rigs.md and DIR/rigs.json compare the
/// errors.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  residyn bench rigs --data measured-logs --only C.1 --out bench-rigs"
)]
pub(super) struct Rigs {
    /// File of the rigs
    #[arg(long, default_value = "configs/bench/rigs.toml", value_name = "FILE")]
    rigs: PathBuf,
    /// Folder of the measured logs; without it, the one that RESIDYN_DATA names
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Folder of the results
    #[arg(long, default_value = "bench-rigs", value_name = "DIR")]
    out: PathBuf,
    /// Only rigs whose name contains one of these; RIG/TEXT: of those rigs, only results whose name, LOG/METHOD,
    /// contains TEXT
    #[arg(long, num_args = 1.., value_name = "RIG")]
    only: Vec<Selection>,
    #[command(flatten)]
    sharding: Sharding,
    #[command(flatten)]
    common: Common,
}

/// What `--only` asks for.
#[derive(Debug, Clone)]
struct Selection {
    rig: String,
    result: String,
}

impl FromStr for Selection {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        let (rig, result) = text.split_once('/').unwrap_or((text, ""));
        Ok(Self {
            rig: rig.to_owned(),
            result: result.to_owned(),
        })
    }
}

impl Rigs {
    /// Whether a rig is asked for, and which of its results.
    fn wants(&self, rig: &str, result: Option<&str>) -> bool {
        let is_it = |only: &Selection| {
            rig.contains(&only.rig) && result.is_none_or(|name| name.contains(&only.result))
        };
        self.only.is_empty() || self.only.iter().any(is_it)
    }
}

/// "No" if something failed.
pub(super) fn run(arguments: &Rigs) -> Result<Answer> {
    let begun = Begun::now();
    let library = Library::built_in();
    let rigs = open(arguments, &library)?;
    let learner = ResidualTrainer {
        backend: arguments.common.device,
    };
    let store = Store {
        folder: RunFolder::open(&arguments.out)?,
        program: program_id()?,
        tools: Tools {
            library: &library,
            learner: Some(&learner),
            seed: arguments.common.seed,
        },
    };
    let work = wanted(arguments, &rigs)?;
    let part = (arguments.sharding).part(&store.folder, store.identity(&work))?;
    let work: Vec<Work<'_>> = shard::of(part.as_ref()).share(work).collect();
    let (lines, not_run) = store.run(&work)?;
    if let Some(part) = part {
        for (method, reason) in not_run {
            terminal::say(format!("note: {} was not run: {reason}", method.name()));
        }
        return shard::finish(part, &arguments.common);
    }
    let summary = summarise(&rigs, &lines, not_run);
    let text = markdown(&summary);
    store.folder.write("rigs.json", &summary)?;
    store.folder.write_text("rigs.md", &text)?;
    let configuration: Vec<&Rig> = rigs.iter().map(|measured| &measured.rig).collect();
    let figure = picture(&summary)?;
    let page = ResultsPage {
        what: "bench rigs",
        headline: &summary.headline(),
        text: &text,
        shares: Vec::new(),
        figure: figure.as_deref(),
        seed: Some(arguments.common.seed),
        configuration: &serde_json::to_value(configuration)?,
        call: &begun.call(&files("rigs", std::slice::from_ref(&arguments.rigs))?),
    };
    page.write(&store.folder)?;
    let json = || Ok::<_, anyhow::Error>(serde_json::to_string_pretty(&summary)? + "\n");
    terminal::print(&if arguments.common.json { json()? } else { text })?;
    Ok(Answer::of(summary.failures.is_empty()))
}

fn open(arguments: &Rigs, library: &Library) -> Result<Vec<Measured>> {
    let named = || env::var_os("RESIDYN_DATA").map(PathBuf::from);
    let data = arguments.data.clone().or_else(named);
    let data =
        data.context("no measured logs; give their folder with --data or in RESIDYN_DATA")?;
    let mut rigs: Vec<Rig> = read(&arguments.rigs)?;
    rigs.retain(|rig| arguments.wants(&rig.name, None));
    if rigs.is_empty() {
        bail!("no rig's name contains what --only asks for");
    }
    let open = |rig| Ok(Measured::open(rig, &data, library)?);
    rigs.into_iter().map(open).collect()
}

/// A piece of work, whose result is stored by itself.
struct Work<'a> {
    rig: &'a Measured,
    fold: &'a Fold,
    method: Method,
}

fn wanted<'a>(arguments: &Rigs, rigs: &'a [Measured]) -> Result<Vec<Work<'a>>> {
    let folds = rigs
        .iter()
        .flat_map(|rig| rig.folds.iter().map(move |fold| (rig, fold)));
    let all = folds.flat_map(|(rig, fold)| Method::ALL.map(|method| Work { rig, fold, method }));
    let is_wanted = |work: &Work<'_>| arguments.wants(&work.rig.rig.name, Some(&work.name()));
    let work: Vec<Work<'_>> = all.filter(is_wanted).collect();
    if work.is_empty() {
        bail!("no result's name contains what --only asks for");
    }
    Ok(work)
}

impl Work<'_> {
    fn name(&self) -> String {
        format!("{}/{}", self.fold.name, self.method.name())
    }
}

/// Stored results.
struct Store<'a> {
    folder: RunFolder,
    /// Hash of this build of the program: another build may give other results.
    program: String,
    tools: Tools<'a>,
}

impl Store<'_> {
    /// What decides the results of all work.
    fn identity(&self, all: &[Work<'_>]) -> Identity {
        let named = |work: &Work<'_>| {
            let name = format!("{}/{}", work.rig.rig.name, work.name());
            (name, self.fingerprint(work))
        };
        Identity {
            command: "bench rigs".to_owned(),
            seed: self.tools.seed,
            config: json!({}),
            inputs: all.iter().map(named).collect(),
        }
    }

    fn fingerprint(&self, work: &Work<'_>) -> String {
        let Work { rig, fold, method } = *work;
        method.fingerprint(rig, fold, self.tools.seed, &self.program)
    }

    /// The results, and which methods cannot be run here; stored results are not computed again.
    fn run(&self, all: &[Work<'_>]) -> Result<(Vec<Line>, BTreeMap<Method, String>)> {
        let line = |work: &Work<'_>, bar: &ProgressBar| Ok((work.method, self.line(work, bar)?));
        let (mut lines, mut not_run) = (Vec::with_capacity(all.len()), BTreeMap::new());
        for (method, line) in progress::each(&self.folder, "results", all, line)? {
            match line {
                Ok(line) => lines.push(line),
                Err(reason) => _ = not_run.insert(method, reason),
            }
        }
        Ok((lines, not_run))
    }

    /// The stored result, the result of doing the work now, or why it cannot be done here.
    fn line(&self, work: &Work<'_>, bar: &ProgressBar) -> Result<Result<Line, String>> {
        let Work { rig, fold, method } = *work;
        let folder = [&rig.rig.name, &fold.name].map(|name| name.replace(['/', '\\'], "-"));
        let folder = self.folder.within(folder.iter().collect::<PathBuf>());
        let file = format!("{}.json", method.name());
        let fingerprint = self.fingerprint(work);
        // A result of another version may not be readable.
        let known = folder
            .text(&file)?
            .and_then(|text| serde_json::from_str(&text).ok());
        if let Some(line) = known.filter(|line: &Line| line.fingerprint == fingerprint) {
            return Ok(Ok(line));
        }
        let begun = Instant::now();
        let found = self.found(work, bar);
        let error = found.as_ref().ok().and_then(|found| found.as_ref().err());
        if let Some(ClientError::Unavailable(reason)) = error.and_then(|error| error.downcast_ref())
        {
            return Ok(Err(reason.clone()));
        }
        let line = Line {
            rig: rig.rig.name.clone(),
            fold: fold.name.clone(),
            method,
            fingerprint,
            seconds: begun.elapsed().as_secs_f64(),
            found: found.and_then(|found| found.map_err(|error| message(&error))),
        };
        folder.write(&file, &line)?;
        Ok(Ok(line))
    }

    fn found(&self, work: &Work<'_>, bar: &ProgressBar) -> Result<Result<Found>, String> {
        let Work { rig, fold, method } = *work;
        let place = format!("{}/{}", rig.rig.name, work.name());
        bar.set_message(place.clone());
        let watch = progress::Step { bar, what: place };
        unless_panic(|| method.run(rig, fold, &self.tools, &watch))
    }
}
