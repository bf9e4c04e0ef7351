//! The page of a report in a real browser.

use std::fs;

use crate::support::clients::look_at;
use crate::support::demo::demo;
use crate::support::paths::configs;
use crate::support::{succeeds, text};

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
