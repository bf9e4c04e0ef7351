//! The report of the demo rig.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::Scratch;

/// The folder that `residyn closeloop` writes for the demo rig; made once for all tests of this file.
pub fn demo() -> &'static Path {
    static FOLDER: OnceLock<(Scratch, PathBuf)> = OnceLock::new();
    let (_, report) = FOLDER.get_or_init(|| {
        let scratch = Scratch::new();
        scratch.succeeds("closeloop --against pendulum --calibrate 1 --out report");
        let report = scratch.path("report");
        (scratch, report)
    });
    report
}
