//! Reports: written as JSON and read back.

use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;

use proptest::prelude::*;
use residyn_report::Report;
use serde_json::Value;
use tempfile::TempDir;

use super::cases;
use super::findings::Rig;
use super::models::words;
use crate::support::clients::client;
use crate::support::paths::schema_path;
use crate::support::{answers, text};

/// Folders of reports: with and without an effect found, of one joint and of two.
fn reports() -> &'static [PathBuf] {
    static FOLDER: OnceLock<(TempDir, Vec<PathBuf>)> = OnceLock::new();
    let (_, reports) = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let write = |(name, rig): (&str, Rig)| {
            let logs = folder.path().join(format!("logs of {name}"));
            fs::create_dir(&logs).unwrap();
            let (model, logs) = rig.write(&logs);
            let out = folder.path().join(name);
            let mut arguments = vec![
                "closeloop",
                "--model",
                text(&model),
                "--out",
                text(&out),
                "--train",
            ];
            arguments.extend(logs[..3].iter().map(|log| text(log)));
            answers(&[&arguments[..], &["--test", text(&logs[3])]].concat());
            out
        };
        let rigs = [
            ("one", Rig::of_one_joint(0)),
            ("two", Rig::of_two_joints(0)),
            ("none", Rig::as_declared()),
        ];
        let written = rigs.map(write).to_vec();
        (folder, written)
    });
    reports
}

/// The content of each of these reports.
fn values() -> Vec<Value> {
    let read = |folder: &PathBuf| fs::read_to_string(folder.join("report.json")).unwrap();
    reports()
        .iter()
        .map(|folder| serde_json::from_str(&read(folder)).unwrap())
        .collect()
}

#[test]
fn reports_read_back_to_the_letter() {
    for folder in reports() {
        let written = fs::read_to_string(folder.join("report.json")).unwrap();
        let again = serde_json::to_string_pretty(&Report::read(folder).unwrap()).unwrap();
        assert_eq!(again.trim_end(), written.trim_end(), "{}", folder.display());
    }
}

#[test]
fn reports_of_all_kinds_match_the_published_schema() {
    for folder in reports() {
        client("report.py", &[folder, &schema_path()]);
    }
}

/// Every number that is not an integer, in the order of the value.
fn leaves<'v>(value: &'v mut Value, found: &mut Vec<&'v mut Value>) {
    if value.is_f64() {
        found.push(value);
        return;
    }
    match value {
        Value::Array(values) => values.iter_mut().for_each(|value| leaves(value, found)),
        Value::Object(values) => (values.values_mut()).for_each(|value| leaves(value, found)),
        _ => {}
    }
}

proptest! {
    #![proptest_config(cases(60))]

    #[test]
    fn reports_of_any_numbers_and_texts_survive(
        which in 0..3_usize,
        numbers in prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::NEGATIVE | prop::num::f64::POSITIVE | prop::num::f64::ZERO, 64),
        texts in prop::collection::vec(words(), 3),
    ) {
        let mut value = values().swap_remove(which);
        let mut found = Vec::new();
        leaves(&mut value, &mut found);
        for (leaf, number) in found.into_iter().zip(numbers.iter().cycle()) {
            *leaf = Value::from(*number);
        }
        for (key, text) in ["headline", "reason", "system"].into_iter().zip(texts) {
            value[key] = Value::from(text);
        }
        let text = serde_json::to_string(&value).unwrap();
        let report: Report = serde_json::from_str(&text).unwrap();
        prop_assert_eq!(serde_json::to_value(&report).unwrap(), value);
    }
}
