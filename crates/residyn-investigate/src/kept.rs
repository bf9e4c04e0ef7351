use std::path::PathBuf;

use residyn_core::data::{Columns, Log};
use residyn_io::runs::RunFolder;
use residyn_io::{read_rig_log, write_log};
use residyn_plants::Controlled;

use super::error::InvestigateError;
use super::round::Round;

const ROUNDS: &str = "rounds.jsonl";

/// What an investigation keeps in its folder: `run-001.csv` and so on, the logs; `rounds.jsonl`, a line for each round. An
/// investigation that is resumed goes on after the last line.
pub struct Kept {
    folder: RunFolder,
    joints: usize,
    columns: Columns,
    pub rounds: Vec<Round>,
    pub logs: Vec<Log>,
}

impl Kept {
    /// Read what is in `folder`, of this plant.
    ///
    /// # Errors
    /// A damaged file.
    pub fn open(folder: &RunFolder, plant: &Controlled) -> Result<Self, InvestigateError> {
        folder.make()?;
        let text = folder.text(ROUNDS)?.unwrap_or_default();
        let read = |(number, line): (usize, &str)| {
            serde_json::from_str(line)
                .map_err(|error| folder.damaged(ROUNDS, format!("line {}: {error}", number + 1)))
        };
        let rounds = (text.lines().enumerate().map(read)).collect::<Result<Vec<Round>, _>>()?;
        let mut kept = Self {
            folder: folder.clone(),
            joints: plant.joints(),
            columns: Columns::standard(plant.joints(), plant.driven_by()),
            logs: Vec::new(),
            rounds,
        };
        for run in 1..=kept.rounds.len() {
            let log = kept.read(run)?;
            kept.logs.push(log);
        }
        Ok(kept)
    }

    fn read(&self, run: usize) -> Result<Log, InvestigateError> {
        Ok(read_rig_log(self.log(run), self.joints, &self.columns)?)
    }

    /// The log of a run, counted from 1.
    pub fn log(&self, run: usize) -> PathBuf {
        self.folder.path().join(format!("run-{run:03}.csv"))
    }

    /// Keep the log of the newest run, whole or not at all, and read it as it is kept.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn keep_log(&mut self, log: &Log) -> Result<(), InvestigateError> {
        let run = self.logs.len() + 1;
        write_log(log, self.log(run))?;
        self.logs.push(self.read(run)?);
        Ok(())
    }

    /// Keep the round of the newest run.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn keep(&mut self, round: Round) -> Result<(), InvestigateError> {
        self.rounds.push(round);
        let line = |round| serde_json::to_string(round).expect("numbers and texts") + "\n";
        let lines: String = self.rounds.iter().map(line).collect();
        Ok(self.folder.write_text(ROUNDS, &lines)?)
    }
}
