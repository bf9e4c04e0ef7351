//! Compares the folders of runs.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

/// A JSON file without the times and the command line.
pub fn read(path: &Path, without: &[&str]) -> Value {
    let mut value: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    for pointer in without {
        assert_ne!(value.pointer_mut(pointer).unwrap().take(), Value::Null);
    }
    value
}

/// All files below a folder except those that only the run itself uses.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            let inside = files(&entry.path()).into_iter();
            found.extend(inside.map(|(path, bytes)| (format!("{name}/{path}"), bytes)));
        } else if !name.starts_with('.') {
            found.insert(name, fs::read(entry.path()).unwrap());
        }
    }
    found
}

/// The folders of two runs of an experiment are equal, except for times.
pub fn ended_alike(merged: &Path, whole: &Path) {
    let clock = ["/wall_s", "/command"];
    let results = |out: &Path| read(&out.join("results.json"), &clock);
    assert_eq!(results(merged), results(whole));
    let [mut merged, mut whole] = [merged, whole].map(files);
    // Both say when and for how long they were computed.
    for found in [&mut merged, &mut whole] {
        found.remove("results.json").unwrap();
        found.remove("report.html").unwrap();
    }
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&merged), names(&whole));
    for (name, bytes) in &merged {
        assert!(whole[name] == *bytes, "{name} differs");
    }
}
