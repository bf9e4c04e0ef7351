//! Measured logs, which are not part of the repository.

use std::io::Write;
use std::path::PathBuf;

use super::paths::ours;

/// The folder of measured logs, `$RESIDYN_DATA` or next to the project; `None`, said loudly, if there is none.
///
/// # Panics
/// If `RESIDYN_REQUIRE_DATA` is set and there is none.
pub fn measured(set: &str) -> Option<PathBuf> {
    let root =
        std::env::var_os("RESIDYN_DATA").map_or_else(|| ours("../shared/data"), PathBuf::from);
    let folder = root.join(set);
    if folder.is_dir() {
        return Some(folder);
    }
    let required = std::env::var_os("RESIDYN_REQUIRE_DATA").is_some();
    assert!(
        !required,
        "measured data are required, and {} is missing",
        folder.display()
    );
    // Not eprintln!, which the test harness swallows.
    let _ = writeln!(
        std::io::stderr(),
        "SKIPPED: no measured data at {}; set RESIDYN_DATA (see README)",
        folder.display()
    );
    None
}
