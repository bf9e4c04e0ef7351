use std::path::PathBuf;

use residyn_core::data::{Columns, Log};
use residyn_io::runs::RunFolder;
use residyn_io::{WriteLogError, read_rig_log, write_log};

use super::error::InvestigateError;
use super::round::Round;

const ROUNDS: &str = "rounds.jsonl";

/// What an investigation keeps in its folder: `run-001.csv` and so on, the logs; `rounds.jsonl`, a line for each round. An
/// investigation that is resumed goes on after the last line.
pub struct Kept {
    folder: RunFolder,
    pub rounds: Vec<Round>,
    pub logs: Vec<Log>,
}

impl Kept {
    /// Read what is in `folder`, of a rig with so many joints.
    ///
    /// # Errors
    /// A damaged file.
    pub fn open(folder: &RunFolder, joints: usize) -> Result<Self, InvestigateError> {
        folder.make()?;
        let text = folder.text(ROUNDS)?.unwrap_or_default();
        let read = |(number, line): (usize, &str)| {
            serde_json::from_str(line)
                .map_err(|error| folder.damaged(ROUNDS, format!("line {}: {error}", number + 1)))
        };
        let rounds = (text.lines().enumerate().map(read)).collect::<Result<Vec<Round>, _>>()?;
        let mut kept = Self {
            folder: folder.clone(),
            logs: Vec::new(),
            rounds,
        };
        for run in 1..=kept.rounds.len() {
            let log = read_rig_log(kept.log(run), joints, &Columns::default())?;
            kept.logs.push(log);
        }
        Ok(kept)
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
        let path = self.log(self.logs.len() + 1);
        let failed = |error: WriteLogError| InvestigateError::Kept(error);
        write_log(log, &path).map_err(failed)?;
        self.logs
            .push(read_rig_log(&path, log.joints(), &Columns::default())?);
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
