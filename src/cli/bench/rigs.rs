use std::env;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Args;
use indicatif::ProgressBar;

use super::{Answer, Common, inputs, program_id, progress, told, unless_panic};
use crate::bench::rigs::{Fold, Line, Measured, Method, Rig, Tools, markdown, read, summarise};
use crate::model::Library;
use crate::runs::RunFolder;
use crate::train::ResidualTrainer;

/// Compare closing the loop with a plain structure and published parameters on measured rigs, on logs left out of the fit
///
/// Each log in turn is left out of the fit and scored. Results are stored one by one in DIR/RIG/LOG; an interrupted run
/// is resumed, and a later run repeats only what has changed since. DIR/rigs.md and DIR/rigs.json compare the errors.
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
    /// Only rigs whose name contains one of these
    #[arg(long, num_args = 1.., value_name = "RIG")]
    only: Vec<String>,
    #[command(flatten)]
    common: Common,
}

/// "No" where something failed.
pub(super) fn run(arguments: &Rigs) -> Result<Answer> {
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
    let summary = summarise(&rigs, &store.run(&rigs)?);
    let text = markdown(&summary);
    store.folder.write("rigs.json", &summary)?;
    store.folder.write_text("rigs.md", &text)?;
    let json = || Ok::<_, anyhow::Error>(serde_json::to_string_pretty(&summary)? + "\n");
    inputs::print(&if arguments.common.json { json()? } else { text })?;
    Ok(if summary.failures.is_empty() {
        Answer::Yes
    } else {
        Answer::No
    })
}

fn open(arguments: &Rigs, library: &Library) -> Result<Vec<Measured>> {
    let named = || env::var_os("RESIDYN_DATA").map(PathBuf::from);
    let data = arguments.data.clone().or_else(named);
    let data =
        data.context("no measured logs; give their folder with --data or in RESIDYN_DATA")?;
    let mut rigs: Vec<Rig> = read(&arguments.rigs)?;
    let only = &arguments.only;
    rigs.retain(|rig| only.is_empty() || only.iter().any(|text| rig.name.contains(text)));
    if rigs.is_empty() {
        bail!("no rig's name contains what --only asks for");
    }
    let open = |rig| Ok(Measured::open(rig, &data, library)?);
    rigs.into_iter().map(open).collect()
}

/// Stored results.
struct Store<'a> {
    folder: RunFolder,
    /// Hash of this build of the program: another build may give other results.
    program: String,
    tools: Tools<'a>,
}

impl Store<'_> {
    /// Results of all methods in all folds; stored ones are not computed again.
    fn run(&self, rigs: &[Measured]) -> Result<Vec<Line>> {
        let folds = rigs
            .iter()
            .flat_map(|rig| rig.folds.iter().map(move |fold| (rig, fold)));
        let work = folds.flat_map(|(rig, fold)| Method::ALL.map(|method| (rig, fold, method)));
        let work: Vec<(&Measured, &Fold, Method)> = work.collect();
        let bar = progress::bar(work.len());
        let mut lines = Vec::with_capacity(work.len());
        for (rig, fold, method) in work {
            let folder = self
                .folder
                .within(file_name(&rig.rig.name))
                .within(file_name(&fold.name));
            let file = format!("{}.json", method.name());
            let configuration = format!("{} {}", rig.fingerprint, self.tools.seed);
            let known = folder.text(&file)?;
            let known: Option<Line> = known.and_then(|text| serde_json::from_str(&text).ok());
            let is_it =
                |line: &Line| line.configuration == configuration && line.program == self.program;
            lines.push(match known.filter(is_it) {
                Some(line) => line,
                None => {
                    let line = self.line(rig, fold, method, configuration, &bar);
                    folder.write(&file, &line)?;
                    line
                }
            });
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(lines)
    }

    fn line(
        &self,
        rig: &Measured,
        fold: &Fold,
        method: Method,
        configuration: String,
        bar: &ProgressBar,
    ) -> Line {
        let begun = Instant::now();
        let place = format!("{}, {}, {}", rig.rig.name, fold.name, method.name());
        bar.set_message(place.clone());
        let mut show = |now: crate::closeloop::Progress<'_>| {
            bar.set_message(format!("{place}: {}", now.text));
        };
        let found = unless_panic(|| method.run(rig, fold, &self.tools, &mut show));
        Line {
            rig: rig.rig.name.clone(),
            fold: fold.name.clone(),
            method,
            configuration,
            program: self.program.clone(),
            seconds: begun.elapsed().as_secs_f64(),
            found: found.and_then(|found| found.map_err(|error| told(&error.into()))),
        }
    }
}

/// A name as that of a folder.
fn file_name(name: &str) -> String {
    name.replace(['/', '\\'], "-")
}
