//! The boundaries between the crates: the table in docs/ARCHITECTURE.md agrees with their manifests, and the core stays
//! free of files, clocks, environment and processes.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use crate::support::paths::{crates, ours};

/// Crates by name, and the crates that each may use.
type Arrows = BTreeMap<String, BTreeSet<String>>;

/// The rows of the tables under "Crates" whose first name satisfies `is_wanted`, each as its cells.
fn rows(is_wanted: impl Fn(&str) -> bool) -> Vec<Vec<String>> {
    let page = fs::read_to_string(ours("docs/ARCHITECTURE.md")).unwrap();
    let (_, section) = page.split_once("\n## Crates\n").unwrap();
    let section = section.split("\n## ").next().unwrap();
    let cells = |line: &str| line.split('|').map(|cell| cell.trim().to_owned()).collect();
    let rows = section.lines().filter(|line| line.starts_with("| `"));
    rows.map(cells)
        .filter(|cells: &Vec<String>| is_wanted(&names(&cells[1])[0]))
        .collect()
}

/// The names in backquotes in a cell.
fn names(cell: &str) -> Vec<String> {
    let quoted = cell.split('`').skip(1).step_by(2);
    quoted.map(str::to_owned).collect()
}

/// The dependencies in the table of crates.
fn declared() -> Arrows {
    let rows = rows(|name| name.starts_with("residyn")).into_iter();
    rows.map(|cells| {
        let used = names(&cells[3]).into_iter().collect();
        (names(&cells[1]).remove(0), used)
    })
    .collect()
}

/// The dependencies in the manifests.
fn built() -> Arrows {
    let dependencies = |folder: &Path| -> BTreeSet<String> {
        let text = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let manifest: toml::Table = text.parse().unwrap();
        let named = manifest["dependencies"].as_table().unwrap().keys();
        let ours = named.filter(|name| name.starts_with("residyn-"));
        ours.cloned().collect()
    };
    let all = crates().into_iter();
    all.map(|(name, folder)| (name, dependencies(&folder)))
        .collect()
}

#[test]
fn the_crates_use_each_other_as_the_architecture_says() {
    assert_eq!(declared(), built());
}

/// The lines of Rust files up to their unit tests, without comments.
fn lines(folder: &Path, found: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() && name != "tests" {
            lines(&path, found);
        } else if name.ends_with(".rs") && name != "tests.rs" {
            let text = fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap();
            let here = path.display().to_string();
            let lines = code
                .lines()
                .filter(|line| !line.trim_start().starts_with("//"));
            found.extend(lines.map(|line| (here.clone(), line.to_owned())));
        }
    }
}

/// Each room may use rooms above it, and none below.
#[test]
fn the_rooms_of_the_core_stand_in_the_order_of_dependence() {
    let rooms: Vec<String> = rows(|name| name.ends_with('/'))
        .iter()
        .map(|cells| names(&cells[1])[0].trim_end_matches('/').to_owned())
        .collect();
    assert!(rooms.len() >= 8, "{rooms:?}");
    for (place, room) in rooms.iter().enumerate() {
        let mut found = Vec::new();
        lines(&ours("crates/residyn-core/src").join(room), &mut found);
        for (file, line) in found {
            for below in &rooms[place + 1..] {
                assert!(
                    !line.contains(&["crate", below, ""].join("::")),
                    "{file}: {line}"
                );
            }
        }
    }
}

#[test]
fn the_core_knows_no_files_clock_environment_or_processes() {
    let mut found = Vec::new();
    lines(&ours("crates/residyn-core/src"), &mut found);
    assert!(found.len() > 20_000, "{}", found.len());
    for (file, line) in found {
        for outside in [
            "std::fs",
            "std::env",
            "std::process",
            "Instant::now",
            "SystemTime",
            "set_hook",
            "thread_rng",
        ] {
            assert!(!line.contains(outside), "{file}: {line}");
        }
    }
}

#[test]
fn only_the_command_line_knows_its_crates() {
    for (name, folder) in crates() {
        let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let uses = |dependency: &str| manifest.lines().any(|line| line.starts_with(dependency));
        assert_eq!(uses("clap "), name == "residyn", "{name}");
        assert!(!uses("indicatif ") || name == "residyn", "{name}");
        let runtime = manifest.split("[dev-dependencies]").next().unwrap();
        assert_eq!(
            runtime.contains("\nburn."),
            name == "residyn-train",
            "{name}"
        );
    }
}
