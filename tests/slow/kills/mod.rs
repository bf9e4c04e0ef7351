//! Long commands that are killed, find the disk full or have their writes cut short, at random instants, half of them
//! exactly when files change. The files that they leave are whole, and the same command then ends with the bytes of an
//! undisturbed run.
//!
//! `RESIDYN_KILLS` is the number of disturbances per command, 4 if it is not set. `--nocapture` shows the table of
//! docs/robustness.md.

#![cfg(target_os = "linux")]

mod commands;
mod faults;

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rand::seq::IteratorRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;

use self::commands::Long;
use self::faults::{Ended, Fault, Layer};

/// Kinds of faults: at file changes with these letters (any change if there are none), or, in capitals, signals at a
/// random time.
const KINDS: [(&str, &str); 12] = [
    ("kill", ""),
    ("full", "omw"),
    ("KILL", ""),
    ("short", "w"),
    ("term", ""),
    ("torn", "w"),
    ("int", ""),
    ("rename", "r"),
    ("TERM", ""),
    ("sync", "s"),
    ("INT", ""),
    ("denied", "omru"),
];

/// Every fourth disturbed run is disturbed a second time before it may end.
const TWICE: usize = 4;

type Files = BTreeMap<PathBuf, Vec<u8>>;

/// All files below a folder.
fn files(folder: &Path) -> Files {
    let mut found = Files::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = PathBuf::from(entry.file_name());
        if entry.path().is_dir() {
            let inside = files(&entry.path()).into_iter();
            found.extend(inside.map(|(path, bytes)| (name.join(path), bytes)));
        } else {
            found.insert(name, fs::read(entry.path()).unwrap());
        }
    }
    found
}

fn is_hidden(path: &Path) -> bool {
    path.iter()
        .any(|part| part.as_encoded_bytes().starts_with(b"."))
}

fn copy(from: &Path, to: &Path) {
    for (path, bytes) in files(from) {
        let path = to.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
}

/// A command and its undisturbed run.
struct Harness {
    scratch: TempDir,
    layer: Layer,
    long: Long,
    /// The files that it leaves.
    end: Files,
    /// Every version of each file from when it got its name.
    ever: Vec<(String, Vec<u8>)>,
    /// A letter for each file change.
    trace: String,
    took: Duration,
}

impl Harness {
    fn new(long: Long) -> Self {
        let scratch = tempfile::tempdir().unwrap();
        let at = |name: &str| {
            let path = scratch.path().join(name);
            fs::create_dir(&path).unwrap();
            path
        };
        let layer = Layer::in_folder(scratch.path());
        let given = at("given");
        (long.prepare)(&given);
        let root = at("undisturbed");
        copy(&given, &root);
        let arguments: Vec<&str> = long.arguments.iter().map(String::as_str).collect();
        let begun = Instant::now();
        let (trace, mut ever) = layer.traced(&root, &arguments, scratch.path());
        let took = begun.elapsed();
        let end = files(&root);
        let last = end.iter().map(|(path, bytes)| (name(path), bytes.clone()));
        ever.extend(last);
        Self {
            end,
            ever,
            trace,
            took,
            layer,
            long,
            scratch,
        }
    }

    fn run(&self, root: &Path, fault: Option<Fault>) -> Ended {
        let arguments: Vec<&str> = self.long.arguments.iter().map(String::as_str).collect();
        self.layer.run(root, &arguments, fault)
    }

    fn draw(&self, number: usize, rng: &mut ChaCha8Rng) -> Fault {
        let (kind, letters) = KINDS[number % KINDS.len()];
        if kind.starts_with(char::is_uppercase) {
            let after = self.took.mul_f64(rng.random());
            return Fault::Signal { name: kind, after };
        }
        let calls = self.trace.chars().zip(1..);
        let of_kind = calls.filter(|(call, _)| letters.is_empty() || letters.contains(*call));
        let (_, at) = of_kind.choose(rng).unwrap();
        Fault::Call { kind, at }
    }

    /// Disturb the command in a new folder, and let it end; the error says what is wrong with the files that it leaves.
    fn disturb(&self, number: usize) -> Result<(), String> {
        let mut rng = ChaCha8Rng::seed_from_u64(number as u64);
        let root = self.scratch.path().join(number.to_string());
        fs::create_dir(&root).unwrap();
        copy(&self.scratch.path().join("given"), &root);
        let times = 1 + usize::from(number % TWICE == TWICE - 1);
        let mut faults = Vec::new();
        for time in 0..times {
            let fault = self.draw(number + 5 * time, &mut rng);
            faults.push(fault);
            let ended = self.run(&root, Some(fault));
            self.check(&root, &fault, &ended)
                .map_err(|wrong| format!("{faults:?}: {wrong}\n{}", ended.said))?;
        }
        self.go_on(&root)
            .map_err(|wrong| format!("{faults:?}, and then: {wrong}"))?;
        fs::remove_dir_all(&root).unwrap();
        Ok(())
    }

    /// The error says what is wrong with the end of a disturbed run.
    fn check(&self, root: &Path, fault: &Fault, ended: &Ended) -> Result<(), String> {
        let found = files(root);
        for (path, bytes) in &found {
            if !is_hidden(path) {
                self.is_whole(path, bytes, fault)?;
            }
        }
        if ended.status.success() {
            return self.compare(found, |path| !is_hidden(path));
        }
        let as_it_should = match fault.kind() {
            "kill" | "KILL" | "torn" => ended.by(9),
            "term" | "TERM" => ended.by(15),
            // Before a handler is installed, the signal ends the program.
            "int" | "INT" => ended.by(2) || ended.status.code() == Some(130),
            "full" | "sync" | "rename" | "denied" => {
                tells(&ended.said, fault)?;
                ended.status.code() == Some(2)
            }
            _ => false,
        };
        match as_it_should {
            true => Ok(()),
            false => Err(format!("it ends with {}", ended.status)),
        }
    }

    /// Whether a file also exists in an undisturbed run, if only for a while.
    fn is_whole(&self, path: &Path, bytes: &[u8], fault: &Fault) -> Result<(), String> {
        let name = name(path);
        let mut versions = self.ever.iter().filter(|(other, _)| *other == name);
        let is_there = match name.ends_with(".jsonl") {
            // Lines are appended to it. Only a kill may cut the last line.
            true => {
                let whole = bytes.iter().rposition(|byte| *byte == b'\n');
                let whole = &bytes[..whole.map_or(0, |last| last + 1)];
                let is_cut = whole.len() < bytes.len() && fault.kind() != "torn";
                !is_cut && versions.any(|(_, version)| version.starts_with(whole))
            }
            false => versions.any(|(_, version)| version == bytes),
        };
        match is_there {
            true => Ok(()),
            false => Err(format!("{} is not whole", path.display())),
        }
    }

    /// Let the command end with the bytes of the undisturbed run, without repeating finished work.
    fn go_on(&self, root: &Path) -> Result<(), String> {
        let said = (self.long.goes_on)(root);
        let done = stretches(root);
        let ended = self.run(root, None);
        if !ended.status.success() {
            return Err(format!("{}\n{}", ended.status, ended.said));
        }
        if let Some(said) = said.filter(|said| !ended.said.contains(said)) {
            return Err(format!("{said:?} is not said:\n{}", ended.said));
        }
        let again = stretches(root);
        if let Some((path, _)) = done.iter().find(|(path, node)| again[*path] != **node) {
            return Err(format!("{} was written again", path.display()));
        }
        self.compare(files(root), |_| true)
    }

    /// Bytes of the undisturbed run's files that are missing or wrong after a fatal disturbance.
    fn lost(&self, number: usize) -> usize {
        let found = files(&self.scratch.path().join(number.to_string()));
        let lost = self
            .end
            .iter()
            .filter(|(path, bytes)| found.get(*path) != Some(*bytes));
        lost.map(|(_, bytes)| bytes.len()).sum()
    }

    fn compare(&self, found: Files, counts: impl Fn(&Path) -> bool) -> Result<(), String> {
        let of = |files: &Files| -> Vec<PathBuf> {
            let names = files.keys().filter(|path| counts(path));
            names.cloned().collect()
        };
        let names = of(&self.end);
        if of(&found) != names {
            return Err(format!("there are {:?}, not {names:?}", of(&found)));
        }
        match names.iter().find(|name| found[*name] != self.end[*name]) {
            Some(name) => Err(format!("{} differs", name.display())),
            None => Ok(()),
        }
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap().to_str().unwrap().to_owned()
}

/// The error names the user's folder instead of a temporary one, and says what to do.
fn tells(said: &str, fault: &Fault) -> Result<(), String> {
    let last = said.lines().last().unwrap_or_default();
    let remedy = match fault.kind() {
        "full" => "free some space",
        _ => "--out",
    };
    let is_good = last.starts_with("error: out") || last.contains(" out");
    let temporary = [".tmp", ".new", ".previous", "room"];
    match is_good && last.contains(remedy) && !temporary.iter().any(|name| last.contains(name)) {
        true => Ok(()),
        false => Err("its message does not help".to_owned()),
    }
}

/// The recorded motion of all finished rounds, and the inode of each file.
fn stretches(root: &Path) -> BTreeMap<PathBuf, u64> {
    let all = files(root);
    let rounds = all
        .iter()
        .filter(|(path, _)| path.ends_with("rounds.jsonl"));
    let done = rounds.flat_map(|(path, bytes)| {
        let rounds = bytes.iter().filter(|byte| **byte == b'\n').count();
        (0..=rounds).map(|k| path.with_file_name(format!("stretch-{k:03}.csv")))
    });
    done.map(|path| {
        let node = fs::metadata(root.join(&path)).unwrap().ino();
        (path, node)
    })
    .collect()
}

/// Disturb a command, `first` being the first of the kinds.
fn survives(long: Long, first: usize) {
    let harness = Harness::new(long);
    let count = std::env::var("RESIDYN_KILLS").map_or(4, |count| count.parse().unwrap());
    let failures: Vec<(usize, String)> = (first..first + count)
        .filter_map(|number| Some((number, harness.disturb(number).err()?)))
        .collect();
    let lost: usize = (failures.iter())
        .map(|(number, _)| harness.lost(*number))
        .sum();
    println!(
        "| `{}` | {} | {count} | {} | {lost} |",
        harness.long.name,
        harness.trace.len(),
        count - failures.len(),
    );
    let message: Vec<String> = failures.into_iter().map(|(_, message)| message).collect();
    assert!(message.is_empty(), "{}", message.join("\n\n"));
}

#[test]
fn a_training_survives() {
    survives(commands::train(), 0);
}

#[test]
fn a_tuning_survives() {
    survives(commands::tune(), 4);
}

#[test]
fn a_sweep_survives() {
    survives(commands::sweep(), 8);
}

#[test]
fn a_loop_of_episodes_survives() {
    survives(commands::mbrl(), 12);
}

#[test]
fn an_experiment_survives() {
    survives(commands::experiment(), 16);
}

#[test]
fn a_bench_survives() {
    survives(commands::bench(), 20);
}

#[test]
fn a_calibration_survives() {
    survives(commands::closeloop(), 24);
}
