//! Every direct dependency has a row in docs/dependencies.toml that says why it is trusted and is right about its
//! version, licence and powers.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde::Deserialize;
use serde_json::Value;

use crate::support::paths::ours;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    rust: BTreeMap<String, Crate>,
    python: BTreeMap<String, Reasons>,
}

/// Facts that `cargo metadata` and the sources state, too.
#[derive(Deserialize)]
struct Crate {
    version: String,
    license: String,
    powers: BTreeSet<String>,
    #[serde(flatten)]
    reasons: Reasons,
}

/// Judgements that only people can make.
#[derive(Deserialize)]
struct Reasons {
    by: String,
    used: String,
    seen: String,
}

impl Reasons {
    fn are_given(&self) -> bool {
        [&self.by, &self.used, &self.seen].map(String::is_empty) == [false; 3]
    }
}

fn record() -> Record {
    let path = ours("docs/dependencies.toml");
    toml::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// What Cargo knows of a package and of its direct dependencies.
struct Package<'a> {
    about: &'a Value,
    names: Vec<&'a Value>,
}

/// The workspace with all features on, so that no dependency is left out.
struct Workspace(Value);

impl Workspace {
    fn read() -> Self {
        let arguments = [
            "metadata",
            "--locked",
            "--all-features",
            "--format-version=1",
        ];
        let mut cargo = Command::new(env!("CARGO"));
        let output = cargo
            .args(arguments)
            .current_dir(ours(""))
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "cargo metadata:\n{errors}");
        Self(serde_json::from_slice(&output.stdout).unwrap())
    }

    fn package(&self, id: &Value) -> Package<'_> {
        let with = |list: &'static str| {
            let entries = list.split('/').fold(&self.0, |value, key| &value[key]);
            let found = entries.as_array().unwrap().iter();
            found
                .into_iter()
                .find(move |entry| entry["id"] == *id)
                .unwrap()
        };
        let named = with("resolve/nodes")["deps"].as_array().unwrap();
        Package {
            about: with("packages"),
            names: named.iter().map(|dependency| &dependency["pkg"]).collect(),
        }
    }

    /// The packages that the manifests name, by name.
    fn direct(&self) -> BTreeMap<&str, Package<'_>> {
        let members = self.0["workspace_members"].as_array().unwrap();
        let ids = members.iter().flat_map(|member| self.package(member).names);
        ids.map(|id| self.package(id))
            .filter(|package| !package.about["source"].is_null())
            .map(|package| (package.about["name"].as_str().unwrap(), package))
            .collect()
    }

    /// Whether a manifest pins this exact version.
    fn is_pinned(&self, name: &str) -> bool {
        let members = self.0["workspace_members"].as_array().unwrap();
        members.iter().any(|member| {
            let asked = &self.package(member).about["dependencies"];
            let mut asked = asked.as_array().unwrap().iter();
            asked.any(|one| one["name"] == name && one["req"].as_str().unwrap().starts_with('='))
        })
    }

    fn powers(&self, package: &Package) -> BTreeSet<String> {
        let mut powers = powers_of_sources(package.about);
        if is_of_kind(package.about, "custom-build") {
            powers.insert("build script");
        }
        let below = package.names.iter().map(|id| self.package(id).about);
        for about in below.chain([package.about]) {
            if is_of_kind(about, "proc-macro") {
                powers.insert("macro");
            }
            if !about["links"].is_null() {
                powers.insert("native");
            }
        }
        powers.into_iter().map(str::to_owned).collect()
    }
}

fn is_of_kind(about: &Value, kind: &str) -> bool {
    let mut targets = about["targets"].as_array().unwrap().iter();
    targets.any(|target| target["kind"].as_array().unwrap().contains(&kind.into()))
}

fn powers_of_sources(about: &Value) -> BTreeSet<&'static str> {
    let manifest = Path::new(about["manifest_path"].as_str().unwrap());
    let mut powers = BTreeSet::new();
    for source in sources(manifest.parent().unwrap()) {
        // Comments in a published source may hold bytes that are not UTF-8.
        let contents = fs::read(&source).unwrap();
        for line in String::from_utf8_lossy(&contents).lines() {
            let code = line.split("//").next().unwrap();
            let is_word = |c: char| c.is_alphanumeric() || c == '_';
            let words: BTreeSet<&str> = code.split(|c| !is_word(c)).collect();
            let has = |wanted: &[&str]| wanted.iter().any(|word| words.contains(word));
            if has(&["unsafe"]) {
                powers.insert("unsafe");
            }
            if has(&["process"]) && has(&["Command"]) {
                powers.insert("processes");
            }
            if has(&[
                "TcpStream",
                "TcpListener",
                "UdpSocket",
                "UnixStream",
                "UnixListener",
            ]) {
                powers.insert("network");
            }
        }
    }
    powers
}

/// All Rust files of a package except its tests, benches and examples.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let found = entries.flat_map(|path| {
        let name = path.file_name().unwrap().to_str().unwrap();
        match path.is_dir() {
            true if ["tests", "benches", "examples", "fuzz"].contains(&name) => vec![],
            true => sources(&path),
            false if name.ends_with(".rs") => vec![path],
            false => vec![],
        }
    });
    found.collect()
}

/// The part of a version that is fixed among compatible releases: 4 of 4.6.7, 0.22 of 0.22.1.
fn compatible(version: &str) -> &str {
    let parts = version.split('.').take_while(|part| *part == "0").count();
    let ends = version.match_indices('.').map(|(end, _)| end);
    &version[..ends.chain([version.len()]).nth(parts).unwrap()]
}

fn names<T>(rows: &BTreeMap<String, T>) -> BTreeSet<&str> {
    rows.keys().map(String::as_str).collect()
}

#[test]
fn every_crate_that_a_manifest_names_has_a_true_row() {
    let workspace = Workspace::read();
    let record = record();
    let direct = workspace.direct();
    let named: BTreeSet<&str> = direct.keys().copied().collect();
    let odd: Vec<_> = named
        .symmetric_difference(&names(&record.rust))
        .copied()
        .collect();
    assert!(
        odd.is_empty(),
        "{odd:?}: docs/dependencies.toml has a row for each dependency, and no other"
    );
    for (name, package) in direct {
        let row = &record.rust[name];
        let seen = |key: &str| package.about[key].as_str().unwrap().to_owned();
        let version = seen("version");
        let version = version.split('+').next().unwrap();
        let same = match workspace.is_pinned(name) {
            true => version == row.version,
            false => compatible(version) == compatible(&row.version),
        };
        assert!(
            same,
            "{name} {version} is not what was looked at, {}",
            row.version
        );
        // The older way to write a choice of licences.
        assert_eq!(seen("license").replace('/', " OR "), row.license, "{name}");
        assert_eq!(
            workspace.powers(&package),
            row.powers,
            "left: powers of {name}, right: its row"
        );
        assert!(row.reasons.are_given(), "{name}");
    }
}

#[test]
fn every_python_package_that_the_wheel_names_has_a_row() {
    let path = ours("python/pyproject.toml");
    let project: toml::Table = fs::read_to_string(path).unwrap().parse().unwrap();
    let extras = project["project"]["optional-dependencies"].as_table();
    let lists = [
        &project["build-system"]["requires"],
        &project["project"]["dependencies"],
    ];
    let lists = lists.into_iter().chain(extras.unwrap().values());
    let asked = lists.flat_map(|list| list.as_array().unwrap());
    let named: BTreeSet<&str> = asked
        .map(|one| {
            one.as_str()
                .unwrap()
                .split(['<', '>', '=', '['])
                .next()
                .unwrap()
        })
        .collect();
    let record = record();
    assert_eq!(names(&record.python), named);
    assert!(record.python.values().all(Reasons::are_given));
}

#[test]
fn compatible_versions_share_their_first_part_that_is_not_zero() {
    let cases = [
        ("4.6.7", "4"),
        ("0.22.1", "0.22"),
        ("0.0.3", "0.0.3"),
        ("2", "2"),
    ];
    for (version, part) in cases {
        assert_eq!(compatible(version), part);
    }
}
