//! `--calibrate`: the findings of each simulation are saved, so that an interrupted calibration can go on.

use anyhow::Result;
use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::cli::shard::program_id;
use crate::cli::{progress, terminal};
use residyn_core::closeloop::{Calibration, Calibrator, Searched, Simulation};
use residyn_core::model::InputFile;
use residyn_core::model::{Model, Origin};
use residyn_io::files::content_id;
use residyn_io::runs::{Lines, RunFolder};

/// A simulation that was searched; one line of `simulations.jsonl`.
#[derive(Serialize, Deserialize)]
pub struct Stored {
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
) -> Result<(Calibration, Lines<Stored>)> {
    let key = |stored: &Stored| stored.configuration.clone();
    let mut store = Lines::open(folder, "simulations.jsonl", key)?;
    let configuration =
        |simulation: &Simulation| content_id(json!([run, simulation.key()]).to_string().as_bytes());
    let all = calibrator.simulations();
    let is_known = |simulation: &&Simulation| store.find(&configuration(simulation)).is_some();
    match all.iter().filter(is_known).count() {
        0 => {}
        kept => terminal::say(format!(
            "note: {} has {kept} of {} simulations",
            folder.path().display(),
            all.len()
        )),
    }
    let search = |simulation: &Simulation, bar: &ProgressBar| {
        let configuration = configuration(simulation);
        let stored = store.find_or_make(&configuration.clone(), || -> Result<_> {
            let what = simulation.about();
            let watch = progress::Step { bar, what };
            Ok(Stored {
                configuration,
                searched: calibrator.search(simulation, &watch)?,
            })
        })?;
        Ok(stored.searched.clone())
    };
    let results = terminal::stage("simulating the accepted model", || {
        progress::each(folder, "simulations", all, search)
    })?;
    Ok((calibrator.conclude(results), store))
}
