//! Work in pieces, one after another; their results are kept as lines of a file, so that an interrupted run goes on.

use std::collections::BTreeMap;

use anyhow::Result;
use indicatif::ProgressBar;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{interrupt, progress};
use residyn_io::runs::{Lines, RunFolder};

/// Do all pieces, `what` in the plural, whose results `folder` keeps.
pub(super) fn each<P, R>(
    folder: &RunFolder,
    what: &'static str,
    pieces: &[P],
    mut work: impl FnMut(&P, &ProgressBar) -> Result<R>,
) -> Result<Vec<R>> {
    let bar = progress::bar(pieces.len());
    let _orderly = interrupt::counted(folder, &bar, what);
    let done = pieces.iter().map(|piece| {
        let result = work(piece, &bar)?;
        bar.inc(1);
        Ok(result)
    });
    let done = done.collect();
    bar.finish_and_clear();
    done
}

/// Results by their keys, each a line of a file.
pub(super) struct Store<R> {
    file: Lines,
    known: BTreeMap<String, R>,
}

impl<R: Serialize + DeserializeOwned> Store<R> {
    /// The results in a file, which need not exist yet.
    pub fn open(folder: &RunFolder, name: &'static str, key: fn(&R) -> String) -> Result<Self> {
        let (file, known) = Lines::open::<R>(folder, name)?;
        let known = known.into_iter().map(|result| (key(&result), result));
        Ok(Self {
            file,
            known: known.collect(),
        })
    }

    pub fn find(&self, key: &str) -> Option<&R> {
        self.known.get(key)
    }

    /// The result that is stored, or else is made now and added.
    pub fn or_make(&mut self, key: String, make: impl FnOnce() -> Result<R>) -> Result<&R> {
        if !self.known.contains_key(&key) {
            let made = make()?;
            self.file.add(&made)?;
            self.known.insert(key.clone(), made);
        }
        Ok(&self.known[&key])
    }

    /// Remove the file, whose results are part of others now.
    pub fn remove(self) -> Result<()> {
        Ok(self.file.remove()?)
    }
}
