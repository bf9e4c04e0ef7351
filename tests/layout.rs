//! How the tests are laid out.

use std::fs;
use std::path::Path;

use crate::support::paths::ours;

/// The sources in a folder of tests and below it, except the shared ones.
fn sources(folder: &Path, found: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("support") {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            found.push((path.display().to_string(), text));
        }
    }
}

#[test]
fn tests_import_what_they_share_and_not_each_other() {
    let mut found = Vec::new();
    sources(&ours("tests"), &mut found);
    assert!(found.len() > 50, "{}", found.len());
    // This file holds the word itself.
    let this = Path::new(file!()).file_name().unwrap().to_str().unwrap();
    for (path, text) in found.iter().filter(|(path, _)| !path.ends_with(this)) {
        for line in text.lines().filter(|line| line.contains("crate::")) {
            let is_shared = !line.replace("crate::support", "").contains("crate::");
            assert!(is_shared, "{path}: {}", line.trim());
        }
    }
}
