//! `--calibrate`: the findings of each simulation are saved, so that an interrupted calibration can go on.

use std::collections::BTreeMap;
use std::time::Instant;

use anyhow::Result;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::cli::shard::program_id;
use crate::cli::{interrupt, progress, terminal};
use residyn_core::closeloop::{Calibration, Calibrator, Searched, Simulation};
use residyn_core::model::InputFile;
use residyn_core::model::{Model, Origin};
use residyn_io::files::content_id;
use residyn_io::runs::{Lines, RunFolder};

/// A simulation that was searched; one line of `simulations.jsonl`.
#[derive(Serialize, Deserialize)]
struct Stored {
    /// Identifies the simulation and what it was made from.
    configuration: String,
    searched: Option<Searched>,
}

/// What decides the results of all simulations: the run, what it read and accepted, and this build of the program.
pub fn run_id(origin: &Origin, accepted: &Model, inputs: &[InputFile]) -> Result<String> {
    let mut config = origin.config.clone();
    // Asking for more simulations leaves the stored ones valid.
    config["calibrate"].take();
    let hashes: Vec<&str> = inputs.iter().map(|input| input.sha256.as_str()).collect();
    let all = json!([program_id()?, config, accepted.file_text(), hashes]);
    Ok(content_id(all.to_string().as_bytes()))
}

/// Search the simulations that are not stored yet. The store may be removed once the report has the results.
pub fn carry_out(
    calibrator: Calibrator<'_>,
    folder: &RunFolder,
    run: &str,
) -> Result<(Calibration, Lines)> {
    let (file, stored) = Lines::open::<Stored>(folder, "simulations.jsonl")?;
    let stored = stored.into_iter();
    let known: BTreeMap<String, Option<Searched>> = stored
        .map(|stored| (stored.configuration, stored.searched))
        .collect();
    let configuration =
        |simulation: &Simulation| content_id(json!([run, simulation.key()]).to_string().as_bytes());
    let all = calibrator.simulations();
    let bar = progress::bar(all.len());
    let _orderly = interrupt::counted(folder, &bar, "simulations");
    let is_known = |simulation: &&Simulation| known.contains_key(&configuration(simulation));
    match all.iter().filter(is_known).count() {
        0 => {}
        kept => terminal::say(format!(
            "note: {} has {kept} of {} simulations",
            folder.path().display(),
            all.len()
        )),
    }
    let begun = Instant::now();
    let mut results = Vec::with_capacity(all.len());
    for simulation in all {
        let configuration = configuration(simulation);
        results.push(match known.get(&configuration) {
            Some(searched) => searched.clone(),
            None => {
                let watch = progress::Step {
                    bar: &bar,
                    what: simulation.about(),
                };
                let searched = calibrator.search(simulation, &watch)?;
                let stored = Stored {
                    configuration,
                    searched,
                };
                file.add(&stored)?;
                stored.searched
            }
        });
        bar.inc(1);
    }
    bar.finish_and_clear();
    terminal::took("simulating the accepted model", begun);
    Ok((calibrator.conclude(results), file))
}
