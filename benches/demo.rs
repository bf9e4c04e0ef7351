//! The logs of `residyn closeloop` without arguments.

use std::path::Path;

use rand_chacha::ChaCha8Rng;
use residyn_core::closeloop::{Settings, Split};
use residyn_core::model::Library;
use residyn_core::plant::Plant;
use residyn_io::plant_from_text;

const DEMO: &str = include_str!("../configs/demo.toml");

/// The rig that records them.
pub fn rig(library: &Library) -> Plant {
    plant_from_text(Path::new("configs/demo.toml"), DEMO, library).expect("the demo's rig")
}

/// A rig's logs, recorded anew and divided as the command divides them.
pub fn recorded(rig: &Plant, rng: &mut ChaCha8Rng) -> Split {
    let logs = (0..rig.recording.logs).map(|_| rig.record(rng).expect("a log"));
    Split::of(logs.collect(), &Settings::default().split)
}
