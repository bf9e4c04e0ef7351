//! A rosbag2 folder. All that is read here is in the recording files, so a folder without `metadata.yaml` is read as
//! well.

use std::path::Path;

use super::{Recording, bag, mcap};
use crate::files::listed;
use residyn_core::data::LogError;

pub(super) fn read(path: &Path, recording: &mut Recording) -> Result<(), LogError> {
    let files = listed(path).map_err(LogError::open(path))?;
    let ends = |end: &'static str| {
        files
            .iter()
            .filter(move |file| file.extension() == Some(end.as_ref()))
    };
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
