use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use clap::Args;
use clap::builder::PossibleValuesParser;
use indicatif::ProgressBar;
use serde_json::Value;

use super::call::{Begun, files};
use super::elsewhere::InItsPlace;
use super::shard::{self, Sharding};
use super::{Answer, Common, command_line, inputs, interrupt, progress, terminal};
use residyn_core::model::Library;
use residyn_experiments::experiment::undeclared_effect::{self, Trial};
use residyn_experiments::experiment::{
    Config, EXPERIMENTS, Experiment, ExperimentError, FinishedRound, Session, picture,
};
use residyn_io::runs::{Identity, RunFolder, Shard};
use residyn_plot::Share;
use residyn_report::ResultsPage;

/// Experiments: return against real transitions, against the receding horizon, and with undeclared effects
///
/// Seeds are counted from --seed. The same command resumes an experiment that was interrupted, and ends with the same
/// numbers.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  residyn experiment physics-prior --config configs/physics-prior/pendulum.toml --out physics-prior"
)]
pub(super) struct Arguments {
    #[arg(value_parser = names())]
    name: String,
    /// The experiment's configuration
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Folder for the results and all runs
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    in_its_place: InItsPlace,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    sharding: Sharding,
    #[command(flatten)]
    common: Common,
}

const UNDECLARED_EFFECT: &str = "undeclared-effect";

fn names() -> PossibleValuesParser {
    let published = EXPERIMENTS.iter().map(|experiment| experiment.name);
    PossibleValuesParser::new(published.chain([UNDECLARED_EFFECT]))
}

/// The file with the time so far, s: not a result, and therefore not merged from parts.
const WALL: &str = ".wall_s";

/// Its files.
const RESULTS: &str = "results.json";
const FIGURE: &str = "results.svg";

/// The results of an experiment, as printed and written.
struct Finished {
    /// The experiment and what it is carried out on.
    what: String,
    headline: String,
    text: String,
    shares: Vec<Share>,
    figure: Option<String>,
    config: Value,
    json: String,
    /// Whether its target was reached.
    answer: Answer,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let begun = Begun::now();
    let read = files("config", std::slice::from_ref(&arguments.config))?;
    let folder = RunFolder::open(&arguments.out)?;
    let clock = Clock::open(&folder)?;
    let library = arguments.effects.library()?;
    let mut published = EXPERIMENTS.iter();
    let finished = match published.find(|known| known.name == arguments.name) {
        Some(experiment) => carry_out_published(arguments, experiment, &library, &clock),
        None => undeclared_effect(arguments, library, &clock),
    }?;
    let Some(finished) = finished else {
        return Ok(Answer::Yes);
    };
    let page = ResultsPage {
        what: &finished.what,
        headline: &finished.headline,
        text: &finished.text,
        shares: finished.shares,
        figure: finished.figure.as_deref(),
        seed: Some(arguments.common.seed),
        configuration: &finished.config,
        call: &begun.call(&read),
    };
    let mut written = vec![page.write(&folder)?];
    let others = [
        (RESULTS, Some(&finished.json)),
        (FIGURE, finished.figure.as_ref()),
    ];
    for (name, contents) in others {
        if let Some(contents) = contents {
            folder.write_text(name, contents)?;
            written.push(arguments.out.join(name));
        }
    }
    let paths: String = (written.iter())
        .map(|path| format!("{}\n", path.display()))
        .collect();
    match arguments.common.json {
        true => terminal::print(&finished.json)?,
        false => terminal::answer(&finished.headline, &(finished.text + &paths))?,
    }
    Ok(finished.answer)
}

/// What is to be done in steps, which are counted for a shard and called `what`, in a stage of this name.
struct Work<'w> {
    run: Identity,
    steps: &'w dyn Fn(Shard) -> usize,
    what: &'static str,
    stage: &'static str,
}

impl Work<'_> {
    /// Do the part that is asked for; the results are those of the whole run, or none.
    fn carry_out<R>(
        self,
        arguments: &Arguments,
        clock: &Clock<'_>,
        body: impl FnOnce(Shard, &ProgressBar) -> Result<R, ExperimentError>,
    ) -> Result<Option<R>> {
        let part = arguments.sharding.part(clock.folder, self.run)?;
        let shard = shard::of(part.as_ref());
        let begun = Instant::now();
        let bar = progress::bar((self.steps)(shard));
        let _orderly = interrupt::counted(clock.folder, &bar, self.what);
        let done = body(shard, &bar);
        bar.finish_and_clear();
        terminal::took(self.stage, begun);
        let done = done?;
        clock.save();
        match part {
            Some(part) => shard::finish(part, &arguments.common).map(|_| None),
            None => Ok(Some(done)),
        }
    }
}

fn carry_out_published(
    arguments: &Arguments,
    experiment: &Experiment,
    library: &Library,
    clock: &Clock<'_>,
) -> Result<Option<Finished>> {
    let Common { device, seed, .. } = arguments.common;
    let mut config = Config::read(&arguments.config)?;
    arguments.in_its_place.put_into(&mut config);
    let reach = arguments.in_its_place.elsewhere.reach();
    let session = Session::open(config, library, device, seed, reach)?;
    let work = Work {
        run: session.run_of_experiment(experiment),
        steps: &|shard| session.rounds(shard),
        what: "rounds",
        stage: "learning and judging",
    };
    let results = work.carry_out(arguments, clock, |shard, bar| {
        let observer = |step: &FinishedRound<'_>| {
            bar.inc(1);
            bar.set_message(message(step));
            if !step.found {
                clock.save();
            }
        };
        session.carry_out(experiment, shard, clock.folder, &observer)
    })?;
    let Some(results) = results else {
        return Ok(None);
    };
    let results = results.finished(command_line(), clock.wall_s());
    Ok(Some(Finished {
        what: format!("{}, {}", results.experiment, results.task),
        headline: results.headline(),
        text: results.text(),
        shares: Vec::new(),
        figure: Some(picture(&results)),
        json: serde_json::to_string_pretty(&results)? + "\n",
        config: results.config,
        answer: Answer::Yes,
    }))
}

fn undeclared_effect(
    arguments: &Arguments,
    library: Library,
    clock: &Clock<'_>,
) -> Result<Option<Finished>> {
    let Common { device, seed, .. } = arguments.common;
    if arguments.in_its_place.plant.is_some() {
        bail!(
            "--plant is for an experiment with one plant; {UNDECLARED_EFFECT} names the plant of each `[[case]]`"
        );
    }
    let experiment = undeclared_effect::Experiment::read(&arguments.config)?;
    let reach = arguments.in_its_place.elsewhere.reach();
    let session = undeclared_effect::Session::new(experiment, library, device, seed, reach)?;
    let work = Work {
        run: session.run_of_all(),
        steps: &|shard| shard.share(session.trials()).count(),
        what: "trials",
        stage: "trials",
    };
    let trials = work.carry_out(arguments, clock, |shard, bar| {
        let observer = |trial: &Trial| {
            bar.inc(1);
            bar.set_message(format!("episodes; {} seed {}", trial.case, trial.seed));
            clock.save();
        };
        session.run_shard(shard, clock.folder, &observer)
    })?;
    let Some(trials) = trials else {
        return Ok(None);
    };
    let outcome = session.results(&trials);
    let mut value = serde_json::to_value(&outcome)?;
    value["experiment"] = UNDECLARED_EFFECT.into();
    value["command"] = command_line().into();
    value["wall_s"] = clock.wall_s().into();
    Ok(Some(Finished {
        what: format!("{UNDECLARED_EFFECT}, {}", session.task.name()),
        headline: outcome.headline(),
        text: outcome.text(),
        shares: outcome.shares(),
        figure: None,
        json: serde_json::to_string_pretty(&value)? + "\n",
        config: value["config"].take(),
        answer: Answer::of(outcome.reached),
    }))
}

/// The text of the progress bar.
pub(super) fn message(step: &FinishedRound<'_>) -> String {
    let FinishedRound {
        method,
        seed,
        round,
        ..
    } = step;
    let (transitions, total) = (round.transitions, round.score.total);
    format!("rounds; {method} seed {seed}: {transitions} transitions, return {total:.1}")
}

/// Measures the total time of an experiment over all interruptions.
struct Clock<'f> {
    began: Instant,
    before_s: f64,
    folder: &'f RunFolder,
}

impl<'f> Clock<'f> {
    fn open(folder: &'f RunFolder) -> Result<Self> {
        let began = Instant::now();
        let before_s = match folder.text(WALL)? {
            Some(text) => text
                .trim()
                .parse()
                .map_err(|_| folder.damaged(WALL, "it is not a number of seconds".to_owned()))?,
            None => 0.0,
        };
        Ok(Self {
            began,
            before_s,
            folder,
        })
    }

    fn wall_s(&self) -> f64 {
        self.before_s + self.began.elapsed().as_secs_f64()
    }

    /// If this fails, only the recorded time is too short.
    fn save(&self) {
        let _ = self
            .folder
            .write_text(WALL, &format!("{}\n", self.wall_s()));
    }
}
