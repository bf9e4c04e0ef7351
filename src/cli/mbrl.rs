use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

use anyhow::Result;
use clap::Args;
use serde_json::json;

use super::elsewhere::InItsPlace;
use super::experiment::message;
use super::{Answer, Common, inputs, interrupt, progress, terminal};
use residyn_experiments::experiment::{Config, FinishedRound, Session};
use residyn_experiments::mbrl::Round;
use residyn_io::runs::RunFolder;

/// Model-based reinforcement learning: train a model, control the plant with it, add the new data, repeat
///
/// One run of one method of an experiment's configuration, with --seed. The same command resumes a run that was
/// interrupted, and ends with the same numbers.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  residyn mbrl --config configs/physics-prior/pendulum.toml --method hybrid --out run --seed 1\n  \
                  residyn mbrl --config rig.toml --plant exec:\"python my_rig.py\" --out run"
)]
pub(super) struct Arguments {
    /// An experiment's configuration
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// One of its methods
    #[arg(long, value_name = "NAME", default_value = "hybrid")]
    method: String,
    /// Folder for rounds.jsonl, the recorded motion as logs, and the last model as a checkpoint
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    in_its_place: InItsPlace,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let Arguments {
        config,
        method,
        out,
        in_its_place,
        effects,
        common,
    } = arguments;
    let folder = RunFolder::open(out)?;
    let library = effects.library()?;
    let mut config = Config::read(config)?;
    in_its_place.put_into(&mut config);
    let reach = in_its_place.elsewhere.reach();
    let session = Session::open(config, &library, common.device, common.seed, reach)?;
    let rounds = Mutex::new(Vec::new());
    let begun = Instant::now();
    let bar = progress::bar(session.rounds_of(method));
    let _orderly = interrupt::counted(&folder, &bar, "rounds");
    let ended = session.run_alone(method, &folder, &|step: &FinishedRound<'_>| {
        bar.inc(1);
        bar.set_message(message(step));
        let mut rounds = rounds
            .lock()
            .expect("nothing panics while it holds the lock");
        rounds.push(step.round.clone());
    });
    bar.finish_and_clear();
    terminal::took("rounds", begun);
    let checkpoint = ended?;
    let rounds = rounds
        .into_inner()
        .expect("nothing panics while it holds the lock");
    let value = || json!({"schema": 1, "out": out, "seed": common.seed, "method": method, "rounds": rounds});
    let headline = format!("checkpoint: {}", checkpoint.display());
    common.answer(value, headline, &table(&rounds, &checkpoint))?;
    Ok(Answer::Yes)
}

fn table(rounds: &[Round], checkpoint: &Path) -> String {
    let mut text = String::from("transitions      return  success  prediction error   ||F_r||\n");
    for round in rounds {
        let success = if round.score.success { "yes" } else { "no" };
        text += &format!(
            "{:>11}  {:>10.2}  {success:>7}  {:>16.3e}  {:>8.4}\n",
            round.transitions, round.score.total, round.error, round.residual_norm
        );
    }
    text + &format!("checkpoint: {}\n", checkpoint.display())
}
