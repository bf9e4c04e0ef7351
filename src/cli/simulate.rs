use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use serde_json::json;

use super::effect_setting::{EffectSetting, add_effects};
use super::elsewhere::Elsewhere;
use super::record::record;
use super::{Answer, Common, inputs, terminal};
use residyn_core::data::Log;
use residyn_core::model::Library;
use residyn_core::plant::Plant;
use residyn_core::rng;
use residyn_io::files::check_room;
use residyn_io::write_log;
use residyn_plants::Controlled;

/// Write the log of a simulated rig, with chosen effects and sensor noise, or of a plant in another process
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  residyn simulate --plant pendulum --effect coulomb_friction=0.16 --out run1.csv --seed 1"
)]
pub(super) struct Arguments {
    /// Plant file, model file, or the name of a built-in system; or a plant in another process, exec:COMMAND or
    /// tcp:HOST:PORT, which moves under a multisine within its limits
    #[arg(long, value_name = "NAME")]
    plant: PathBuf,
    #[command(flatten)]
    elsewhere: Elsewhere,
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
    check_room(&arguments.out)?;
    let (log, effects) = match arguments.elsewhere.open(&arguments.plant, &library)? {
        Controlled::Simulated(simulation) => simulated(arguments, simulation.plant, &library)?,
        Controlled::Elsewhere(fleet) => {
            if !arguments.effect.is_empty() {
                bail!("--effect is for a simulated rig; a plant in another process has its own");
            }
            let Arguments {
                out,
                duration,
                common,
                ..
            } = arguments;
            let duration_s = duration
                .context("a plant in another process has no length of its own; add --duration")?;
            let recorded = || record(&fleet, duration_s, common.seed, out);
            (terminal::stage("recording", recorded)?, Vec::new())
        }
    };
    let value = || json!({"out": arguments.out, "rows": log.rows(), "duration_s": log.duration(), "effects": effects});
    let (out, rows, duration_s) = (arguments.out.display(), log.rows(), log.duration());
    let line = format!("{out}: {rows} rows, {duration_s} s");
    (arguments.common).answer(value, &line, &format!("{line}\n"))?;
    Ok(Answer::Yes)
}

/// The log of a simulated rig, and the names of its effects.
fn simulated(
    arguments: &Arguments,
    mut plant: Plant,
    library: &Library,
) -> Result<(Log, Vec<String>)> {
    add_effects(&mut plant, library, &arguments.effect)?;
    if let Some(duration) = arguments.duration {
        let lasting = plant.lasting(duration);
        plant = lasting.with_context(|| format!("--duration {duration:?}"))?;
    }
    let mut rng = rng(arguments.common.seed);
    let log = terminal::stage("simulating", || plant.record(&mut rng))?;
    write_log(&log, &arguments.out).context("the log was not written")?;
    let effects = plant.effects.iter().map(|e| e.effect.name.clone());
    Ok((log, effects.collect()))
}
