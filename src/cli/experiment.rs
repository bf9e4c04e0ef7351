use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};

use super::{Answer, Common, inputs, progress};
use crate::experiment::undeclared_effect::{self, Lab, Trial};
use crate::experiment::{Config, Experiment, Session, Step, picture};
use crate::model::Library;
use crate::report::write_whole;

/// Experiments: return against real transitions, against the receding horizon, and with effects that nobody declared
///
/// The same command goes on with an experiment that was interrupted, and ends with the same numbers.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  residyn experiment physics-prior --config configs/physics-prior/pendulum.toml --out physics-prior"
)]
pub(super) struct Arguments {
    #[arg(value_enum)]
    name: Name,
    /// What is compared, on which task and plant
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Folder for the results and all runs
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Name {
    PhysicsPrior,
    OfflinePrior,
    RecedingHorizon,
    UndeclaredEffect,
}

/// What there is to say of an experiment.
struct Finished {
    json: String,
    text: String,
    /// Whether what it aims at was reached.
    answer: Answer,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let out = &arguments.out;
    inputs::check_writable(out)?;
    let clock = Clock::open(out)?;
    let library = arguments.effects.library()?;
    let published = |experiment| published(arguments, experiment, &library, &clock);
    let finished = match arguments.name {
        Name::PhysicsPrior => published(Experiment::PhysicsPrior),
        Name::OfflinePrior => published(Experiment::OfflinePrior),
        Name::RecedingHorizon => published(Experiment::RecedingHorizon),
        Name::UndeclaredEffect => undeclared_effect(arguments, library, &clock),
    }?;
    clock.save();
    write_whole(&out.join("results.json"), finished.json.as_bytes())?;
    let json = arguments.common.json;
    inputs::print(if json { &finished.json } else { &finished.text })?;
    Ok(finished.answer)
}

fn published(
    arguments: &Arguments,
    experiment: Experiment,
    library: &Library,
    clock: &Clock,
) -> Result<Finished> {
    let (config, out) = (Config::read(&arguments.config)?, &arguments.out);
    let session = Session::open(config, library, arguments.common.device)?;
    let bar = progress::bar(session.rounds());
    let results = session.carry_out(experiment, out, &|step: &Step<'_>| {
        bar.inc(1);
        bar.set_message(message(step));
        if !step.found {
            clock.save();
        }
    });
    bar.finish_and_clear();
    let results = results?.finished(command(arguments, experiment.name()), clock.wall_s());
    write_whole(&out.join("results.svg"), picture(&results)?.as_bytes())?;
    Ok(Finished {
        json: serde_json::to_string_pretty(&results)? + "\n",
        text: format!(
            "{}{}",
            results.text(),
            files(out, &["results.json", "results.svg"])
        ),
        answer: Answer::Yes,
    })
}

fn undeclared_effect(arguments: &Arguments, library: Library, clock: &Clock) -> Result<Finished> {
    let out = &arguments.out;
    let experiment = undeclared_effect::Experiment::read(&arguments.config)?;
    let lab = Lab::new(experiment, library, arguments.common.device)?;
    let trials = lab.experiment.seeds * lab.plants.len() as u64;
    let bar = progress::bar(usize::try_from(trials)?);
    let outcome = lab.run(out, &|trial: &Trial| {
        bar.inc(1);
        bar.set_message(format!("episodes; {} seed {}", trial.case, trial.seed));
        clock.save();
    });
    bar.finish_and_clear();
    let outcome = outcome?;
    let mut value = serde_json::to_value(&outcome)?;
    value["experiment"] = "undeclared-effect".into();
    value["command"] = command(arguments, "undeclared-effect").into();
    value["wall_s"] = clock.wall_s().into();
    Ok(Finished {
        json: serde_json::to_string_pretty(&value)? + "\n",
        text: format!("{}{}", outcome.text(), files(out, &["results.json"])),
        answer: if outcome.reached {
            Answer::Yes
        } else {
            Answer::No
        },
    })
}

fn command(arguments: &Arguments, name: &str) -> String {
    let Arguments { config, out, .. } = arguments;
    format!(
        "residyn experiment {name} --config {} --out {}",
        config.display(),
        out.display()
    )
}

fn files(out: &Path, names: &[&str]) -> String {
    names
        .iter()
        .map(|name| format!("{}\n", out.join(name).display()))
        .collect()
}

/// For the progress bar.
pub(super) fn message(step: &Step<'_>) -> String {
    let Step {
        method,
        seed,
        round,
        ..
    } = step;
    let (transitions, total) = (round.transitions, round.judged.total);
    format!("rounds; {method} seed {seed}: {transitions} transitions, return {total:.1}")
}

/// The time that all sessions of an experiment took.
struct Clock {
    began: Instant,
    before_s: f64,
    path: PathBuf,
}

impl Clock {
    fn open(out: &Path) -> Result<Self> {
        let began = Instant::now();
        let path = out.join("wall_s");
        let before_s = match std::fs::read_to_string(&path) {
            Ok(text) => text
                .trim()
                .parse()
                .with_context(|| format!("{} is no number of seconds", path.display()))?,
            Err(_) => 0.0,
        };
        Ok(Self {
            began,
            before_s,
            path,
        })
    }

    fn wall_s(&self) -> f64 {
        self.before_s + self.began.elapsed().as_secs_f64()
    }

    /// A failure costs no more than a time that is too short.
    fn save(&self) {
        let _ = write_whole(&self.path, format!("{}\n", self.wall_s()).as_bytes());
    }
}
