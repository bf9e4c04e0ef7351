use std::collections::BTreeMap;

use anyhow::Result;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::cli::shard::program_id;
use residyn_io::files::content_id;
use residyn_io::runs::{Lines, RunFolder};
use residyn_train::Trained;
use residyn_train::recipe::{Job, Member};

/// Models that were trained, in the folder of a sweep.
pub struct Store {
    folder: RunFolder,
    file: Lines,
    /// Hash of the run that every model is trained in, and of this build of the program: another one may give other results.
    run: String,
    known: BTreeMap<String, Stored>,
}

/// A model; one line of `models.jsonl`.
#[derive(Serialize, Deserialize)]
pub struct Stored {
    /// Identifies the model and what it was trained by.
    configuration: String,
    /// Time that its training took, s.
    pub seconds: f64,
    pub trained: Trained,
}

impl Store {
    pub fn open(folder: &RunFolder, job: &Job) -> Result<Self> {
        let (file, stored) = Lines::open::<Stored>(folder, "models.jsonl")?;
        let by_name = |stored: Stored| (stored.configuration.clone(), stored);
        Ok(Self {
            folder: folder.clone(),
            file,
            run: content_id(
                json!([job.identity(), program_id()?])
                    .to_string()
                    .as_bytes(),
            ),
            known: stored.into_iter().map(by_name).collect(),
        })
    }

    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

    pub fn find(&self, member: &Member) -> Option<&Stored> {
        self.known.get(&self.configuration(member))
    }

    pub fn add(&mut self, member: &Member, trained: Trained, seconds: f64) -> Result<()> {
        let configuration = self.configuration(member);
        let stored = Stored {
            configuration: configuration.clone(),
            seconds,
            trained,
        };
        self.file.add(&stored)?;
        self.known.insert(configuration, stored);
        Ok(())
    }

    fn configuration(&self, member: &Member) -> String {
        content_id(json!([self.run, member]).to_string().as_bytes())
    }
}
