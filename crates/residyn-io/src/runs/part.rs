use serde::{Deserialize, Serialize};
use serde_json::json;

use super::difference::first_difference;
use super::{Identity, RunFolder, RunFolderError, Shard};

/// What a folder is a part of.
pub(super) const RECORD: &str = "shard.json";

/// The folder of a run that holds one shard of it, to be merged with the others by [`merge`](super::merge()).
#[derive(Debug)]
pub struct Part {
    folder: RunFolder,
    pub(super) record: Record,
}

/// `shard.json`
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Record {
    /// Version of the program.
    residyn: String,
    /// Hash of the build of the program: another build may give other numbers.
    program: String,
    #[serde(flatten)]
    run: Identity,
    pub shard: Shard,
    /// Whether all of the shard's work is done.
    pub finished: bool,
}

impl Part {
    /// Record that the folder holds this shard of `run`, done by this build of the `program`, or check that it does.
    ///
    /// # Errors
    /// The folder holds something else, or cannot be written.
    pub fn begin(
        folder: &RunFolder,
        shard: Shard,
        run: Identity,
        program: String,
    ) -> Result<Self, RunFolderError> {
        let mine = Record {
            residyn: env!("CARGO_PKG_VERSION").to_owned(),
            program,
            run,
            shard,
            finished: false,
        };
        if let Some(saved) = folder.read::<Record>(RECORD)? {
            let other_shard = || first_difference("shard", &json!(saved.shard), &json!(shard));
            folder.refuse(mine.difference(&saved).or_else(other_shard))?;
        }
        folder.write(RECORD, &mine)?;
        Ok(Self {
            folder: folder.clone(),
            record: mine,
        })
    }

    /// The part in a folder; `None` if there is none.
    ///
    /// # Errors
    /// A damaged record.
    pub(super) fn find(folder: RunFolder) -> Result<Option<Self>, RunFolderError> {
        let record = folder.read(RECORD)?;
        Ok(record.map(|record| Self { folder, record }))
    }

    /// Record that all of the shard's work is done.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn finish(mut self) -> Result<(), RunFolderError> {
        self.record.finished = true;
        self.folder.write(RECORD, &self.record)
    }

    /// The folder that holds it.
    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

    /// Which shard it is.
    pub fn shard(&self) -> Shard {
        self.record.shard
    }
}

impl Record {
    /// How the run of this part differs from the run of a `saved` part, in words; `None` if they are the same.
    pub fn difference(&self, saved: &Self) -> Option<String> {
        let build = |part: &Self| json!({"residyn": part.residyn, "program": part.program});
        first_difference("", &build(saved), &build(self))
            .or_else(|| self.run.difference(&saved.run))
            .or_else(|| {
                let of = |part: &Self| json!(part.shard.all().count());
                first_difference("number of shards", &of(saved), &of(self))
            })
    }
}
