//! Flags belong to the command line: the library says what is wrong without them, and `src/cli` adds which flag fixes
//! it.

use residyn::read_standard_log;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::paths::{crates, ours};
use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, says, succeeds, swinging};

/// The flags that a text names: `--train` and the like.
fn flags(text: &str) -> BTreeSet<String> {
    let named = text.split("--").skip(1).map(|rest| {
        let is_name = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let end = rest.find(|c| !is_name(c)).unwrap_or(rest.len());
        format!("--{}", &rest[..end])
    });
    named.filter(|flag| flag.len() > 2).collect()
}

/// The flags of all commands, without those of every program.
fn own_flags() -> BTreeSet<String> {
    let mut own = flags(&succeeds(&["completions", "bash"]));
    for general in ["--help", "--version"] {
        assert!(own.remove(general), "{general}");
    }
    own
}

/// The Rust files below a folder, except those in one folder.
fn sources(folder: &Path, but: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && path != but {
            sources(&path, but, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn the_library_names_no_flag() {
    let own = own_flags();
    assert!(
        own.contains("--train") && own.contains("--leave-out"),
        "{own:?}"
    );
    let mut files = Vec::new();
    for (_, folder) in crates() {
        sources(&folder.join("src"), &ours("src/cli"), &mut files);
    }
    assert!(files.len() > 300, "{}", files.len());
    for file in files {
        let named = flags(&fs::read_to_string(&file).unwrap());
        let named: Vec<&String> = named.intersection(&own).collect();
        assert!(named.is_empty(), "{}: {named:?}", file.display());
    }
}

/// Commands, and words of their messages.
const MENDED: &str = "
closeloop --model pendulum --out out --train long.csv --test short.csv | the test logs contain no window ... --test names the test logs
closeloop --model pendulum --out out --train long.csv --errors torque | torques cannot be compared ... pendulum gives accelerations ... --errors motion compares the motion
new --from-urdf y.urdf | joint `j40` is one too many: at most 40 ... --tip names the last body
";

#[test]
fn the_command_line_says_which_flag_mends_an_error() {
    let scratch = Scratch::new();
    let times = (0..9).map(|row| 0.01 * f64::from(row));
    scratch.log_at("short.csv", times, |_| [0.0; 3]);
    scratch.log("long.csv", swinging);
    let spokes = (0..41).map(|k| {
        format!(
            r#"<link name="l{k}"/><joint name="j{k}" type="continuous"><parent link="base"/><child link="l{k}"/></joint>"#
        )
    });
    let spokes: String = spokes.collect();
    scratch.file(
        "y.urdf",
        format!(r#"<robot name="y"><link name="base"/>{spokes}</robot>"#),
    );
    for [line, words] in rows(MENDED) {
        says_words(&scratch.refuses(&line), &words);
    }
}

#[test]
fn a_finding_is_mended_by_a_flag_on_the_command_line_alone() {
    let scratch = Scratch::new();
    // The logger stopped for half a second.
    let times = (0..600).map(|row| 0.01 * f64::from(row) + if row < 300 { 0.0 } else { 0.5 });
    let log = scratch.log_at("gap.csv", times, swinging);
    let output = scratch.run("audit gap.csv");
    let message = String::from_utf8(output.stdout).unwrap();
    says(&message, &["paste: --leave-out gap.csv@"]);
    let log = read_standard_log(Path::new(&log)).unwrap();
    let audit = residyn_core::data::audit(&log, &residyn_core::data::Columns::default());
    let message = audit.to_string();
    assert!(
        message.contains("leave out gap.csv@") && !message.contains("--"),
        "{message}"
    );
}
