//! The page of a report in a real browser.

use std::fs;
use std::io::Write;
use std::path::Path;

use crate::clients::{client, demo};
use crate::support::{refuses, succeeds, text};
use crate::train::configs;

/// Whether there is a browser; without one, say so loudly. CI must have it.
fn has_browser() -> bool {
    let is_there =
        ["chromium", "chromedriver"].map(|name| Path::new("/usr/bin").join(name).exists());
    if is_there == [true; 2] {
        return true;
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "CI needs chromium and chromium-driver"
    );
    let note = "SKIPPED page.py: chromium and chromium-driver are not installed\n";
    // Not eprintln!, which the test harness swallows.
    let _ = std::io::stderr().write_all(note.as_bytes());
    false
}

/// Look at a page in a browser, where there is one.
pub fn look_at(page: &Path) {
    if has_browser() {
        client("page.py", &[page]);
    }
}

#[test]
fn a_browser_shows_the_page_of_the_demo() {
    look_at(&demo().join("report.html"));
}

#[test]
fn a_browser_shows_the_page_of_an_experiment_on_control() {
    let folder = tempfile::tempdir().unwrap();
    let config = configs().join("smoke/undeclared-effect.toml");
    let arguments = ["experiment", "undeclared-effect", "--config", text(&config)];
    succeeds(&[&arguments[..], &["--out", text(folder.path())]].concat());
    look_at(&folder.path().join("report.html"));
}

#[test]
fn page_and_text_are_made_again_from_report_json_alone() {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(
        demo().join("report.json"),
        folder.path().join("report.json"),
    )
    .unwrap();
    succeeds(&["report", text(folder.path())]);
    for name in ["report.html", "report.md"] {
        let [first, again] =
            [demo(), folder.path()].map(|at| fs::read_to_string(at.join(name)).unwrap());
        assert!(first == again, "the two {name} differ");
    }
}

#[test]
fn folders_without_a_report_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let said = refuses(&["report", text(folder.path())]);
    assert!(
        said.contains("report.json") && said.contains("residyn closeloop"),
        "{said}"
    );
    fs::write(
        folder.path().join("report.json"),
        "{\"schema\": 1,\n nonsense}",
    )
    .unwrap();
    let said = refuses(&["report", text(folder.path())]);
    assert!(said.contains("line 2 column"), "{said}");
    assert!(!folder.path().join("report.html").exists());
}
