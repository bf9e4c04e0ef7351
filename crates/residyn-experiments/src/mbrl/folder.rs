use std::fs;
use std::path::{Path, PathBuf};

use super::{Round, Run, RunError, RunState};
use residyn_core::data::{Columns, Log};
use residyn_core::model::{Dynamics, Origin};
use residyn_io::runs::{RunFolder, RunFolderError};
use residyn_io::{read_rig_log, write_log};
use residyn_train::{Checkpoint, Training, save};

const ROUNDS: &str = "rounds.jsonl";

/// What a run keeps in its folder: `stretch-000.csv` and so on, the recorded motion; `rounds.jsonl`, a line for each
/// round; and `checkpoint-001` or later, the model after the last one. A run that is resumed from them ends with the
/// same numbers.
pub struct Folder {
    folder: RunFolder,
    rounds: Vec<Round>,
}

/// Where a run in `folder` keeps the recorded motion of this number.
pub(super) fn stretch(folder: &Path, number: usize) -> PathBuf {
    folder.join(format!("stretch-{number:03}.csv"))
}

impl Folder {
    /// Reads the rounds in `folder`, which is created if missing.
    ///
    /// # Errors
    /// A folder that cannot be made, or a damaged file.
    pub fn open(folder: RunFolder) -> Result<Self, RunError> {
        folder.make()?;
        let text = folder.text(ROUNDS)?.unwrap_or_default();
        let read = |(number, line): (usize, &str)| {
            serde_json::from_str(line)
                .map_err(|error| folder.damaged(ROUNDS, format!("line {}: {error}", number + 1)))
        };
        let rounds = text.lines().enumerate().map(read);
        let found = Self {
            rounds: rounds.collect::<Result<_, _>>()?,
            folder,
        };
        // A run that was killed may have left one.
        found.remove_earlier_checkpoints()?;
        Ok(found)
    }

    /// The rounds done so far.
    pub fn rounds(&self) -> &[Round] {
        &self.rounds
    }

    /// The checkpoint of the model after the last round.
    pub fn checkpoint(&self) -> PathBuf {
        self.checkpoint_after(self.rounds.len())
    }

    fn checkpoint_after(&self, rounds: usize) -> PathBuf {
        self.folder.path().join(format!("checkpoint-{rounds:03}"))
    }

    /// The state of the run so far; a run without rounds is started. `dynamics` are the equations of its model file.
    ///
    /// # Errors
    /// A damaged file, or a plant that diverges.
    pub fn state(&self, run: &Run<'_>, dynamics: &Dynamics) -> Result<RunState, RunError> {
        let done = self.rounds.len();
        if done == 0 {
            let state = run.begin()?;
            self.write_stretch(&state.logs[0], 0)?;
            return Ok(state);
        }
        let joints = run.plant.joints();
        let columns = Columns::standard(joints, run.plant.driven_by());
        let read = |number| read_rig_log(self.stretch(number), joints, &columns);
        let device = run.learner.backend.device();
        let checkpoint = Checkpoint::load(&self.checkpoint())?;
        Ok(RunState {
            logs: (0..=done).map(read).collect::<Result<_, _>>()?,
            model: Some(checkpoint.model(dynamics, &device)?),
            rounds: done,
        })
    }

    /// Keep the results of a round. Its line is written last: a round without a line is repeated from the model before
    /// it, which is therefore removed after that.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn keep(
        &mut self,
        round: Round,
        state: &RunState,
        training: &Training,
        origin: &Origin,
    ) -> Result<(), RunError> {
        let logs = &state.logs;
        self.write_stretch(&logs[logs.len() - 1], logs.len() - 1)?;
        self.rounds.push(round);
        save(&self.checkpoint(), training, origin)?;
        let line = |round| serde_json::to_string(round).expect("numbers and texts") + "\n";
        let lines: String = self.rounds.iter().map(line).collect();
        self.folder.write_text(ROUNDS, &lines)?;
        self.remove_earlier_checkpoints()
    }

    fn remove_earlier_checkpoints(&self) -> Result<(), RunError> {
        let earlier = (1..self.rounds.len()).map(|rounds| self.checkpoint_after(rounds));
        for path in earlier.filter(|path| path.exists()) {
            fs::remove_dir_all(&path).map_err(|source| RunFolderError::Io {
                action: "removed",
                path,
                source,
            })?;
        }
        Ok(())
    }

    fn stretch(&self, number: usize) -> PathBuf {
        stretch(self.folder.path(), number)
    }

    fn write_stretch(&self, log: &Log, number: usize) -> Result<(), RunError> {
        Ok(write_log(log, self.stretch(number))?)
    }
}
