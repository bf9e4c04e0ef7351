//! Every reader on damaged and on hostile files: each is read or refused, in little time and memory, without a panic.
//!
//! An input is identified by its target and its number, which seeds its random numbers. `RESIDYN_FUZZ=N` runs the first
//! N inputs of each target instead of the usual ones, `RESIDYN_FUZZ=A..B` those from A to before B: see
//! docs/robustness.md.

mod edits;
mod measure;
mod packed;
mod seeds;
mod targets;
mod watch;

use std::fs;
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use residyn_io::files::content_hash;

use self::edits::{Form, edited};
use self::measure::{Cost, cost};
use self::watch::Watch;

/// A reader, and the inputs that it is tested on.
struct Target {
    name: &'static str,
    /// How many inputs are tried unless the environment says otherwise.
    inputs: u64,
    form: Form,
    /// Valid files; none if they cannot be made here.
    seeds: fn() -> Vec<Vec<u8>>,
    /// Packs an input into a file, if the format is packed.
    pack: fn(Vec<u8>, &mut ChaCha8Rng) -> Vec<u8>,
    /// Lays out the folder that inputs are read from, and names the input's file.
    place: fn(&Path) -> PathBuf,
    /// Reads the input in that file and makes use of it. Returns whether it is accepted.
    read: fn(&Path) -> bool,
}

impl Target {
    fn run(&self) {
        let seeds = (self.seeds)();
        if seeds.is_empty() {
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let file = (self.place)(folder.path());
        let asked = asked();
        if asked.is_some() {
            tell(&format!(
                "{}: each input is at {}",
                self.name,
                file.display()
            ));
        }
        let (begun, mut all) = (Instant::now(), All::default());
        let watch = Watch::of(self.name);
        for number in asked.clone().unwrap_or(0..self.inputs) {
            let input = self.input(number, &seeds);
            fs::write(&file, &input).unwrap();
            watch.begin(number);
            match cost(input.len(), || (self.read)(&file)) {
                Ok(cost) => all.add(cost),
                Err(fault) => all.faults.push(self.kept(number, &fault, &input)),
            }
            if all.faults.len() == MOST_FAULTS {
                break;
            }
        }
        if asked.is_some() {
            tell(&format!(
                "| {} | {} |",
                self.name,
                all.row(begun.elapsed().as_secs_f64())
            ));
        }
        assert!(all.faults.is_empty(), "{}", all.faults.join("\n"));
        // The first inputs are the seeds: a target that refuses them all tests little of its reader.
        assert!(
            asked.is_some() || all.accepted > 0,
            "{} accepts no input",
            self.name
        );
    }

    /// The input with this number. The first inputs are the seeds themselves.
    fn input(&self, number: u64, seeds: &[Vec<u8>]) -> Vec<u8> {
        let mut rng = ChaCha8Rng::seed_from_u64(content_hash(self.name.as_bytes()) ^ number);
        let seed = usize::try_from(number).ok().and_then(|k| seeds.get(k));
        let input = seed.cloned();
        let input = input.unwrap_or_else(|| edited(self.form, seeds, &mut rng));
        (self.pack)(input, &mut rng)
    }

    /// A description of the fault, and where the input is kept.
    fn kept(&self, number: u64, fault: &str, input: &[u8]) -> String {
        let folder = std::env::temp_dir().join("residyn-fuzz");
        fs::create_dir_all(&folder).unwrap();
        let file = folder.join(format!("{}-{number}", self.name));
        fs::write(&file, input).unwrap();
        let message = format!(
            "{} {number} {fault}: {} bytes at {}",
            self.name,
            input.len(),
            file.display()
        );
        if asked().is_some() {
            tell(&message);
        }
        message
    }
}

/// Faults after which a target is given up.
const MOST_FAULTS: usize = 50;

/// The total cost of all inputs.
#[derive(Default)]
struct All {
    worst: Cost,
    inputs: u64,
    accepted: u64,
    faults: Vec<String>,
}

impl All {
    fn add(&mut self, cost: Cost) {
        self.worst.seconds = self.worst.seconds.max(cost.seconds);
        self.worst.bytes = self.worst.bytes.max(cost.bytes);
        self.inputs += 1;
        self.accepted += u64::from(cost.accepted);
    }

    /// Inputs, accepted inputs, total time, worst time and worst memory.
    fn row(&self, seconds: f64) -> String {
        let percent = 100.0 * self.accepted as f64 / self.inputs.max(1) as f64;
        let (time, memory) = (
            1e3 * self.worst.seconds,
            self.worst.bytes as f64 / f64::from(1 << 20),
        );
        format!(
            "{} | {percent:.1} % | {seconds:.0} s | {time:.0} ms | {memory:.1} MB",
            self.inputs
        )
    }
}

/// The numbers of the inputs that `RESIDYN_FUZZ` asks for.
fn asked() -> Option<Range<u64>> {
    let text = std::env::var("RESIDYN_FUZZ").ok()?;
    let (from, to) = text.split_once("..").unwrap_or(("0", &text));
    let number = |text: &str| text.parse::<u64>().expect("RESIDYN_FUZZ is N or A..B");
    Some(number(from)..number(to))
}

/// Bypasses the test harness, which captures what is printed.
fn tell(line: &str) {
    let _ = std::io::stderr().write_all(format!("{line}\n").as_bytes());
}
