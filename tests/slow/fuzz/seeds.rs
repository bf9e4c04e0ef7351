//! Valid files of every format: our own, those that the program writes, and those of other libraries.

use std::fs;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

use residyn_control::control::Task;
use residyn_core::expr::parse;
use residyn_experiments::experiment;
use residyn_experiments::experiment::undeclared_effect;
use residyn_formats as formats;
use residyn_formats::RobotReader;
use residyn_train::recipe::Recipe;
use residyn_validation as bench;

use crate::support::demo::demo;
use crate::support::exported_models::{CHECKPOINT, exported};
use crate::support::log_files::{formats, recordings, trajectory};
use crate::support::paths::ours;

/// All files in a folder and its subfolders, sorted by name.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let within = |path: PathBuf| match path.is_dir() {
        true => files(&path),
        false => vec![path],
    };
    paths.into_iter().flat_map(within).collect()
}

/// The files that are such.
fn contents(
    files: impl IntoIterator<Item = PathBuf>,
    is_such: impl Fn(&Path) -> bool,
) -> Vec<Vec<u8>> {
    let such = files.into_iter().filter(|path| is_such(path));
    such.map(|path| fs::read(path).unwrap()).collect()
}

/// The files of these names, in a folder that may not be there.
fn named(folder: Option<&Path>, names: &str) -> Vec<Vec<u8>> {
    let read = |folder: &Path| {
        names
            .split(' ')
            .map(|name| fs::read(folder.join(name)).unwrap())
            .collect()
    };
    folder.map_or_else(Vec::new, read)
}

fn ends(with: &'static str) -> impl Fn(&Path) -> bool {
    move |path| path.extension().is_some_and(|extension| extension == with)
}

fn configs(is_such: impl Fn(&Path) -> bool) -> Vec<Vec<u8>> {
    contents(files(&ours("configs")), is_such)
}

/// The reader of descriptions in this format.
pub fn robots(format: &str) -> &'static RobotReader {
    let format = formats::find(format).unwrap();
    format.robots.as_ref().expect("a format of robots")
}

/// Quoted texts in models and effects that are formulas.
pub fn formulas() -> Vec<Vec<u8>> {
    let texts = [models(), effects()].concat();
    let quoted = |text: Vec<u8>| {
        let text = String::from_utf8(text).unwrap();
        text.split('"').map(str::to_owned).collect::<Vec<_>>()
    };
    let mut all: Vec<String> = texts.into_iter().flat_map(quoted).collect();
    all.retain(|text| parse(text).is_ok_and(|formula| formula.terms() > 1));
    all.sort();
    all.dedup();
    all.into_iter().map(String::into_bytes).collect()
}

/// Model files, including those made from robot descriptions.
pub fn models() -> Vec<Vec<u8>> {
    let built_in = ["acrobot", "cartpole", "drive", "motor", "pendulum", "servo"];
    let built_in = built_in.map(|name| ours("models").join(name).with_extension("toml"));
    let written = [built_in.to_vec(), files(&ours("docs/rigs"))].concat();
    let derived = ["urdf", "mjcf"].into_iter().flat_map(|format| {
        let extension = if format == "urdf" { "urdf" } else { "xml" };
        let described = files(&ours("tests/fixtures/mechanisms"))
            .into_iter()
            .filter(move |path| ends(extension)(path));
        // Some fixtures are meant to be refused.
        described.filter_map(move |path| robots(format).model(&path, None, None).ok())
    });
    let derived = derived.map(|(model, _)| model.text.into_bytes());
    contents(written, |_| true)
        .into_iter()
        .chain(derived)
        .collect()
}

pub fn effects() -> Vec<Vec<u8>> {
    contents(files(&ours("models/effects")), |_| true)
}

pub fn recipes() -> Vec<Vec<u8>> {
    configs(|path| Recipe::read(path).is_ok())
}

pub fn tasks() -> Vec<Vec<u8>> {
    configs(|path| Task::read(path).is_ok())
}

pub fn plants() -> Vec<Vec<u8>> {
    contents(files(&ours("configs/plants")), |_| true)
}

pub fn experiments() -> Vec<Vec<u8>> {
    configs(|path| {
        experiment::Config::read(path).is_ok() || undeclared_effect::Experiment::read(path).is_ok()
    })
}

/// Without the largest grid, which is slow to expand.
pub fn benches() -> Vec<Vec<u8>> {
    configs(|path| {
        bench::read(path).is_ok_and(|cells| cells.len() < 200) || bench::rigs::read(path).is_ok()
    })
}

pub fn urdf() -> Vec<Vec<u8>> {
    contents(files(&ours("tests/fixtures/mechanisms")), ends("urdf"))
}

pub fn mjcf() -> Vec<Vec<u8>> {
    contents(files(&ours("tests/fixtures/mechanisms")), ends("xml"))
}

pub fn manifests() -> Vec<Vec<u8>> {
    named(Some(&ours(CHECKPOINT)), "checkpoint.json")
}

pub fn weights() -> Vec<Vec<u8>> {
    named(
        Some(&ours(CHECKPOINT)),
        "weights.safetensors last.safetensors",
    )
}

pub fn optimizers() -> Vec<Vec<u8>> {
    named(Some(&ours(CHECKPOINT)), "optimizer.bpk")
}

/// The descriptions of tensors, which precede the numbers.
pub fn tensors() -> Vec<Vec<u8>> {
    let described = |file: Vec<u8>| {
        let (length, rest) = file.split_first_chunk().unwrap();
        rest[..u64::from_le_bytes(*length) as usize].to_vec()
    };
    weights().into_iter().map(described).collect()
}

pub fn descriptions() -> Vec<Vec<u8>> {
    named(Some(exported()), "model.json")
}

pub fn reports() -> Vec<Vec<u8>> {
    named(Some(demo()), "report.json")
}

pub fn csv() -> Vec<Vec<u8>> {
    let run = trajectory();
    let german = run.replace(',', ";").replace('.', ",");
    let tabs = run.replace(',', "\t");
    [run, german, tabs].map(String::into_bytes).to_vec()
}

pub fn npz() -> Vec<Vec<u8>> {
    named(
        formats(),
        "matrices.npz columns.npz fortran.npz integers.npz pickled.npz",
    )
}

pub fn pt() -> Vec<Vec<u8>> {
    named(
        formats(),
        "double.pt pace.pt named.pt ticks.pt legged.pt numpy.pt hostile.pt",
    )
}

pub fn hdf5() -> Vec<Vec<u8>> {
    named(
        formats(),
        "plain.h5 chunked.h5 big_endian.h5 latest.h5 integers.h5 episode.hdf5 demos.hdf5 seven.mat",
    )
}

/// The descriptions of tensors in these files.
pub fn pickles() -> Vec<Vec<u8>> {
    let described = |file: Vec<u8>| {
        let mut archive = zip::ZipArchive::new(Cursor::new(file)).unwrap();
        let mut pickle = Vec::new();
        let mut entry = archive.by_name("run/data.pkl").unwrap();
        entry.read_to_end(&mut pickle).unwrap();
        pickle
    };
    pt().into_iter().map(described).collect()
}

/// One NumPy array.
pub fn npy() -> Vec<Vec<u8>> {
    let matrix = |header: &str, numbers: Vec<u8>| {
        let length = (header.len() as u16).to_le_bytes();
        [
            b"\x93NUMPY\x01\x00",
            &length[..],
            header.as_bytes(),
            &numbers,
        ]
        .concat()
    };
    let numbers = (0..100).map(|k| 0.1 * f64::from(k));
    vec![
        matrix(
            "{'descr': '<f8', 'fortran_order': False, 'shape': (50, 2), }",
            numbers.clone().flat_map(f64::to_le_bytes).collect(),
        ),
        matrix(
            "{'descr': '<f4', 'fortran_order': True, 'shape': (50, 2), }",
            numbers
                .flat_map(|number| (number as f32).to_le_bytes())
                .collect(),
        ),
        matrix(
            "{'descr': '|u1', 'fortran_order': False, 'shape': (50,), }",
            (0..50).collect(),
        ),
    ]
}

pub fn mat() -> Vec<Vec<u8>> {
    named(formats(), "plain.mat packed.mat columns.mat integers.mat")
}

pub fn parquet() -> Vec<Vec<u8>> {
    named(
        formats(),
        "none.parquet lists.parquet snappy.parquet gzip.parquet zstd.parquet lz4.parquet",
    )
}

pub fn lerobot() -> Vec<Vec<u8>> {
    named(formats(), "single/meta/info.json")
}

/// The file of episodes of that data set.
pub fn episodes() -> PathBuf {
    formats()
        .expect("asked where there are seeds")
        .join("single/data/chunk-000/file-000.parquet")
}

pub fn bags() -> Vec<Vec<u8>> {
    named(
        recordings(),
        "alone.db3 messages_packed/messages_packed.db3",
    )
}

pub fn mcap() -> Vec<Vec<u8>> {
    named(
        recordings(),
        "loose.mcap plain.mcap zstd.mcap lz4.mcap commands.mcap ros_json.mcap foxglove.mcap",
    )
}
