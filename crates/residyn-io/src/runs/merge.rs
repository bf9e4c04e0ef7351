use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::part::{Part, RECORD};
use super::{RunFolder, RunFolderError, Shard};
use crate::files::{OutputError, listed, write_whole};

/// What a merged run still lacks.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Lacking {
    /// Shards that none of the parts holds.
    pub missing: Vec<Shard>,
    /// Parts whose work is not done.
    pub unfinished: Vec<(Shard, PathBuf)>,
}

/// Why parts cannot be merged. Nothing was written, unless the writing itself failed.
#[derive(Debug, Error)]
pub enum MergeError {
    #[error("{path} is not part of a run: it has no {RECORD}", path = .path.display())]
    NoPart { path: PathBuf },
    #[error("{path} is not from the same run as {first}: {difference}", path = .path.display(), first = .first.display())]
    OtherRun {
        path: PathBuf,
        first: PathBuf,
        difference: String,
    },
    #[error("{one} and {other} are two results of the same piece of work", one = .one.display(), other = .other.display())]
    TwoResults { one: PathBuf, other: PathBuf },
    #[error("{path} cannot be read: {source}", path = .path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Folder(#[from] RunFolderError),
    #[error("{0}")]
    Output(#[from] OutputError),
}

/// Files by their paths within a folder, and all folders that have one.
type Files = BTreeMap<PathBuf, Vec<PathBuf>>;

/// Merge the results in the `parts` of a run into the folder `out`, where the run itself then finds them. Lines of
/// `.jsonl` files are results by themselves, all other files are whole. The contents of `out` count as a part, so that
/// merging can be repeated.
///
/// # Errors
/// A folder that is not a part or is a part of another run or build, two results of one piece of work, or files that
/// cannot be read or written.
pub fn merge(parts: &[PathBuf], out: &RunFolder) -> Result<Lacking, MergeError> {
    let parts: Vec<Part> = parts
        .iter()
        .map(|path| open(path))
        .collect::<Result<_, _>>()?;
    one_run(&parts)?;
    let folders = parts.iter().map(Part::folder).chain([out]);
    let mut files = Files::new();
    for folder in folders.filter(|folder| folder.path().is_dir()) {
        list(folder.path(), Path::new(""), &mut files)?;
    }
    // All are compared before the first is written.
    for (name, sources) in &files {
        contents(name, sources)?;
    }
    for (name, sources) in &files {
        let path = out.path().join(name);
        let within = out.within(name.parent().unwrap_or(Path::new("")));
        within.make()?;
        write_whole(&path, &contents(name, sources)?)?;
    }
    Ok(lacking(&parts))
}

fn open(path: &Path) -> Result<Part, MergeError> {
    let none = || MergeError::NoPart {
        path: path.to_owned(),
    };
    if !path.is_dir() {
        return Err(none());
    }
    Part::find(RunFolder::open(path)?)?.ok_or_else(none)
}

fn one_run(parts: &[Part]) -> Result<(), MergeError> {
    let Some((first, others)) = parts.split_first() else {
        return Ok(());
    };
    let path = |part: &Part| part.folder().path().to_owned();
    for part in others {
        if let Some(difference) = first.record.difference(&part.record) {
            return Err(MergeError::OtherRun {
                path: path(part),
                first: path(first),
                difference,
            });
        }
    }
    Ok(())
}

/// Add all files within `folder` below `at`. Files whose names begin with a dot are temporary and left by killed runs.
fn list(folder: &Path, at: &Path, files: &mut Files) -> Result<(), MergeError> {
    let path = folder.join(at);
    for entry in listed(&path).map_err(unreadable(&path))? {
        let own = entry.file_name().unwrap_or_default();
        let name = at.join(own);
        if own.to_string_lossy().starts_with('.') || name == Path::new(RECORD) {
            continue;
        }
        if entry.is_dir() {
            list(folder, &name, files)?;
        } else {
            files.entry(name).or_default().push(entry);
        }
    }
    Ok(())
}

/// The merged contents of the file of this name.
fn contents(name: &Path, sources: &[PathBuf]) -> Result<Vec<u8>, MergeError> {
    let read = |path: &PathBuf| fs::read(path).map_err(unreadable(path));
    let all: Vec<Vec<u8>> = sources.iter().map(read).collect::<Result<_, _>>()?;
    if name.extension() == Some("jsonl".as_ref()) {
        return Ok(joined(&all));
    }
    match all.iter().position(|other| *other != all[0]) {
        Some(other) => Err(MergeError::TwoResults {
            one: sources[0].clone(),
            other: sources[other].clone(),
        }),
        None => Ok(all.into_iter().next().unwrap_or_default()),
    }
}

fn unreadable(path: &Path) -> impl FnOnce(io::Error) -> MergeError {
    move |source| MergeError::Read {
        path: path.to_owned(),
        source,
    }
}

/// The lines of files without repeats, in the order in which they come.
fn joined(files: &[Vec<u8>]) -> Vec<u8> {
    let mut seen = BTreeSet::new();
    let lines = files
        .iter()
        .flat_map(|file| file.split(|byte| *byte == b'\n'));
    let new = lines.filter(|line| !line.is_empty() && seen.insert(*line));
    new.flat_map(|line| [line, b"\n"].concat()).collect()
}

fn lacking(parts: &[Part]) -> Lacking {
    let all = parts.first().map(|part| part.shard().all());
    let is_there = |shard: &Shard| parts.iter().any(|part| part.shard() == *shard);
    let unfinished = parts.iter().filter(|part| !part.record.finished);
    Lacking {
        missing: all
            .into_iter()
            .flatten()
            .filter(|shard| !is_there(shard))
            .collect(),
        unfinished: unfinished
            .map(|part| (part.shard(), part.folder().path().to_owned()))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::{Path, PathBuf};

    use serde_json::json;

    use super::{MergeError, Part, RunFolder, merge};
    use crate::runs::Identity;

    /// A folder that holds a shard, with these files.
    fn part(
        parent: &Path,
        shard: &str,
        epochs: u32,
        build: &str,
        files: &[(&str, &str)],
    ) -> PathBuf {
        let path = parent.join(shard.replace('/', "-of-"));
        let folder = RunFolder::open(&path).unwrap();
        let run = Identity {
            command: "experiment".to_owned(),
            seed: 0,
            config: json!({"epochs": epochs}),
            inputs: [].into(),
        };
        let part = Part::begin(&folder, shard.parse().unwrap(), run, build.to_owned()).unwrap();
        for (name, text) in files {
            let inside = folder.within(Path::new(name).parent().unwrap());
            let name = Path::new(name).file_name().unwrap().to_str().unwrap();
            inside.write_text(name, text).unwrap();
        }
        part.finish().unwrap();
        path
    }

    #[test]
    fn results_come_together_and_may_do_so_twice() {
        let parent = tempfile::tempdir().unwrap();
        let (run, cut) = (("run.json", "{}"), (".tmpX", "half"));
        let lines = [("c.jsonl", "\na\n\nb\n\nhal"), ("c.jsonl", "\nb\n\nc\n")];
        let parts = [
            part(
                parent.path(),
                "1/2",
                40,
                "x",
                &[run, lines[0], cut, ("runs/a/r.csv", "1")],
            ),
            part(
                parent.path(),
                "2/2",
                40,
                "x",
                &[run, lines[1], ("runs/b/r.csv", "2")],
            ),
        ];
        let out = RunFolder::open(&parent.path().join("out")).unwrap();
        for _ in 0..2 {
            assert_eq!(merge(&parts, &out).unwrap(), Default::default());
            let text = |name: &str| fs::read_to_string(out.path().join(name)).unwrap();
            assert_eq!(text("c.jsonl"), "a\nb\nhal\nc\n");
            assert_eq!(
                (text("runs/a/r.csv"), text("runs/b/r.csv")),
                ("1".into(), "2".into())
            );
            let there: Vec<_> = fs::read_dir(out.path()).unwrap().collect();
            assert_eq!(there.len(), 3, "{there:?}");
        }
    }

    #[test]
    fn what_is_missing_or_not_done_is_reported() {
        let parent = tempfile::tempdir().unwrap();
        let first = part(parent.path(), "1/3", 40, "x", &[]);
        let second = part(parent.path(), "2/3", 40, "x", &[]);
        let record = fs::read_to_string(second.join("shard.json")).unwrap();
        let cut = record.replace("\"finished\": true", "\"finished\": false");
        fs::write(second.join("shard.json"), cut).unwrap();
        let out = RunFolder::open(&parent.path().join("out")).unwrap();
        let lacking = merge(&[first, second.clone()], &out).unwrap();
        assert_eq!(lacking.missing, ["3/3".parse().unwrap()]);
        assert_eq!(lacking.unfinished, [("2/3".parse().unwrap(), second)]);
    }

    #[test]
    fn parts_that_do_not_belong_together_are_refused_and_nothing_is_written() {
        let parent = tempfile::tempdir().unwrap();
        let of = |name: &str, shard, epochs, build, text| {
            let folder = parent.path().join(name);
            part(
                &folder,
                shard,
                epochs,
                build,
                &[("a.csv", "1"), ("b.csv", text)],
            )
        };
        let first = of("a", "1/2", 40, "x", "1");
        let out = RunFolder::open(&parent.path().join("out")).unwrap();
        let message = |other: PathBuf| {
            let message = merge(&[first.clone(), other], &out).unwrap_err();
            assert!(!out.path().exists());
            message.to_string()
        };
        let cases = [
            (
                of("b", "2/2", 50, "x", "1"),
                "its `epochs` is 50, here it is 40",
            ),
            (
                of("c", "2/2", 40, "y", "1"),
                "its `program` is \"y\", here it is \"x\"",
            ),
            (
                of("d", "2/3", 40, "x", "1"),
                "its `number of shards` is 3, here it is 2",
            ),
            (
                of("e", "2/2", 40, "x", "2"),
                "b.csv are two results of the same piece of work",
            ),
            (
                parent.path().to_owned(),
                "is not part of a run: it has no shard.json",
            ),
            (parent.path().join("none"), "is not part of a run"),
        ];
        for (other, part) in cases {
            let message = message(other);
            assert!(message.contains(part), "{part}: {message}");
        }
        let working = RunFolder::open(&first).unwrap();
        let busy = merge(&[first], &out).unwrap_err();
        assert!(matches!(busy, MergeError::Folder(_)), "{busy}");
        drop(working);
    }
}
