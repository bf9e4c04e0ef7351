use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};

use super::{Answer, Common, inputs, progress};
use crate::experiment::{Config, Experiment, Results, Session, Step, picture};
use crate::report::write_whole;

/// The published experiments: return against real transitions, and against the receding horizon
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
    /// Folder for results.json, results.svg and all runs
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Folders of your own effect files
    #[arg(long, num_args = 1.., value_name = "DIR")]
    effects: Vec<PathBuf>,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Name {
    PhysicsPrior,
    OfflinePrior,
    RecedingHorizon,
}

impl From<Name> for Experiment {
    fn from(name: Name) -> Self {
        match name {
            Name::PhysicsPrior => Self::PhysicsPrior,
            Name::OfflinePrior => Self::OfflinePrior,
            Name::RecedingHorizon => Self::RecedingHorizon,
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let began = Instant::now();
    let Arguments {
        name,
        config,
        out,
        effects,
        common,
    } = arguments;
    inputs::check_writable(out)?;
    let library = inputs::library(effects)?;
    let experiment = Experiment::from(*name);
    let session = Session::open(Config::read(config)?, &library, common.device)?;
    let clock = Clock::open(out, began)?;
    let bar = progress::bar(session.rounds());
    let results = session.carry_out(experiment, out, &|step: &Step<'_>| {
        bar.inc(1);
        bar.set_message(message(step));
        if !step.found {
            clock.save();
        }
    });
    bar.finish_and_clear();
    let command = format!(
        "residyn experiment {} --config {} --out {}",
        experiment.name(),
        config.display(),
        out.display()
    );
    let results = results?.finished(command, clock.wall_s());
    let json = serde_json::to_string_pretty(&results)? + "\n";
    write_whole(&out.join("results.json"), json.as_bytes())?;
    write_whole(&out.join("results.svg"), picture(&results)?.as_bytes())?;
    clock.save();
    inputs::print(&if common.json {
        json
    } else {
        text(&results, out)
    })?;
    Ok(Answer::Yes)
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

fn text(results: &Results, out: &Path) -> String {
    let files = ["results.json", "results.svg"].map(|name| out.join(name).display().to_string());
    format!("{}{}\n", results.text(), files.join("\n"))
}

/// The time that all sessions of an experiment took.
struct Clock {
    began: Instant,
    before_s: f64,
    path: PathBuf,
}

impl Clock {
    fn open(out: &Path, began: Instant) -> Result<Self> {
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
