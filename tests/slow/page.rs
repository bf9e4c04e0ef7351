//! The page of a report in a real browser.

use std::fs;

use crate::support::Scratch;
use crate::support::clients::look_at;
use crate::support::demo::demo;

#[test]
fn a_browser_shows_the_page_of_the_demo() {
    look_at(&demo().join("report.html"));
}

#[test]
fn a_browser_shows_the_page_of_an_experiment_on_control() {
    let scratch = Scratch::new();
    let config = "--config $REPO/configs/smoke/undeclared-effect.toml";
    scratch.succeeds(&format!("experiment undeclared-effect {config} --out out"));
    look_at(&scratch.path("out/report.html"));
}

#[test]
fn page_and_text_are_made_again_from_report_json_alone() {
    let scratch = Scratch::new();
    fs::copy(demo().join("report.json"), scratch.path("report.json")).unwrap();
    scratch.succeeds("report .");
    for name in ["report.html", "report.md"] {
        let first = fs::read_to_string(demo().join(name)).unwrap();
        assert!(first == scratch.read(name), "the two {name} differ");
    }
}
