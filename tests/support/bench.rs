//! A small bench of rigs on simulated logs.

use std::fs;
use std::path::Path;

use residyn::read_model;
use residyn_core::model::Library;
use residyn_io::write_log;
use residyn_validation::{Cell, Source, read as grid};

use super::Scratch;
use super::paths::ours;

/// Four logs of a pendulum with dry friction.
fn record(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let mut cell: Cell = grid(&ours("configs/bench/smoke.toml")).unwrap().remove(0);
    let Source::Simulated(simulation) = &mut cell.source else {
        panic!("the grid's rigs are simulated")
    };
    simulation.condition.logs = 4;
    let model = read_model(&cell.model, &Library::built_in()).unwrap();
    for log in cell.record(&model).unwrap().0 {
        write_log(&log, folder.join(&log.path)).unwrap();
    }
}

/// The rig's true values, without its friction, as the published parameter set.
pub const RIGS: &str = r#"
plain = ["coulomb_friction"]

[[rig]]
name = "rig"
folder = "logs"
model = "pendulum"
parameters = { C_i = 5.0 }
logs = ["log1.csv", "log2.csv", "log3.csv"]
test = "each_log"
leave_out = ["log2.csv@7.5-8"]
published = [{ name = "1.0", model = "pendulum", parameters = { C_g = -19.62, C_i = 6.6667 } }]
also = { fourth = ["log4.csv"] }
"#;

/// The command in a folder of [`bench`].
pub const COMMAND: &str = "bench rigs --rigs rigs.toml --data . --out out";

/// A folder with a file of rigs, `rigs.toml`, and the logs.
pub fn bench(rigs: &str) -> Scratch {
    let scratch = Scratch::new();
    record(&scratch.path("logs"));
    scratch.file("rigs.toml", rigs);
    scratch
}
