//! A rosbag2 folder. All that is read here is in the recording files, so a folder without `metadata.yaml` is read as
//! well.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::{Recording, bag, mcap};
use residyn_core::data::LogError;

pub(super) fn read(path: &Path, recording: &mut Recording) -> Result<(), LogError> {
    let files = files(path).map_err(|why| LogError::Open {
        path: path.to_owned(),
        why,
    })?;
    let ends = |end: &'static str| files.iter().filter(move |file| has_extension(file, end));
    if let Some(packed) = ends("zstd").next() {
        let name = packed.display();
        return Err(recording.fault(format!(
            "is packed file by file; unpack it: `zstd -d {name}`"
        )));
    }
    if ends("db3").chain(ends("mcap")).next().is_none() {
        let fault =
            "is a folder without a recording: rosbag2 has .db3 or .mcap files there; name a file";
        return Err(recording.fault(fault.to_owned()));
    }
    ends("db3").try_for_each(|file| bag::read(file, recording))?;
    ends("mcap").try_for_each(|file| mcap::read(file, recording))
}

fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder)?;
    let mut files: Vec<PathBuf> = entries
        .map(|entry| Ok(entry?.path()))
        .collect::<io::Result<_>>()?;
    files.sort();
    Ok(files)
}

fn has_extension(file: &Path, wanted: &str) -> bool {
    file.extension()
        .is_some_and(|extension| extension == wanted)
}
