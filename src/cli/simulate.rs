use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use serde_json::json;

use super::effect_setting::{EffectSetting, add_effects};
use super::{Answer, Common, inputs, terminal};
use residyn_core::rng;
use residyn_io::files::check_room;
use residyn_io::{read_plant, write_log};

/// Write the log of a simulated rig, with chosen effects and sensor noise
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  residyn simulate --plant pendulum --effect coulomb_friction=0.16 --out run1.csv --seed 1"
)]
pub(super) struct Arguments {
    /// Plant file, model file, or the name of a built-in system
    #[arg(long, value_name = "FILE")]
    plant: PathBuf,
    /// Log file to write
    #[arg(long, value_name = "LOG")]
    out: PathBuf,
    /// NAME=VALUE sets an effect's first parameter; NAME.PARAMETER=VALUE another; NAME@JOINT=VALUE on a joint
    #[arg(long, num_args = 1.., value_name = "NAME=VALUE")]
    effect: Vec<EffectSetting>,
    /// Length in s; the plant's own if not given
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let library = arguments.effects.library()?;
    let mut plant = read_plant(&arguments.plant, &library)?;
    add_effects(&mut plant, &library, &arguments.effect)?;
    if let Some(duration) = arguments.duration {
        let lasting = plant.lasting(duration);
        plant = lasting.with_context(|| format!("--duration {duration:?}"))?;
    }
    check_room(&arguments.out)?;
    let mut rng = rng(arguments.common.seed);
    let log = terminal::stage("simulating", || plant.record(&mut rng))?;
    write_log(&log, &arguments.out).context("the log was not written")?;
    let effects: Vec<&str> = plant
        .effects
        .iter()
        .map(|e| e.effect.name.as_str())
        .collect();
    let value = || json!({"out": arguments.out, "rows": log.rows(), "duration_s": log.duration(), "effects": effects});
    let (out, rows, duration_s) = (arguments.out.display(), log.rows(), log.duration());
    let line = format!("{out}: {rows} rows, {duration_s} s");
    (arguments.common).answer(value, &line, &format!("{line}\n"))?;
    Ok(Answer::Yes)
}
