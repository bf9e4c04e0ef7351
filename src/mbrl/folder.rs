use std::fs;
use std::path::{Path, PathBuf};

use super::{Experience, Progress, Round, Run, RunError};
use crate::data::{Columns, Log};
use crate::model::{Dynamics, Origin};
use crate::report::write_whole;
use crate::train::{Checkpoint, Training, save};

const ROUNDS: &str = "rounds.jsonl";

/// Where a run is kept: `stretch-000.csv` and on, what was seen of the plant; `rounds.jsonl`, a line for each round; and
/// `checkpoint-001` or later, the model after the last one. A run goes on from what lies there, and ends with the same
/// numbers.
pub struct Folder {
    dir: PathBuf,
    rounds: Vec<Round>,
}

impl Folder {
    /// What lies in `dir`; it is made where it is missing.
    ///
    /// # Errors
    /// A folder that cannot be made, or a damaged file.
    pub fn open(dir: &Path) -> Result<Self, RunError> {
        let saved = |path: &Path| {
            let path = path.to_owned();
            move |message| RunError::Saved { path, message }
        };
        fs::create_dir_all(dir).map_err(|error| saved(dir)(error.to_string()))?;
        let path = dir.join(ROUNDS);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(saved(&path)(error.to_string())),
        };
        let read = |(number, line): (usize, &str)| {
            serde_json::from_str(line).map_err(|error| {
                saved(&path)(format!(
                    "line {}: {error}; remove {}",
                    number + 1,
                    dir.display()
                ))
            })
        };
        Ok(Self {
            rounds: text
                .lines()
                .enumerate()
                .map(read)
                .collect::<Result<_, _>>()?,
            dir: dir.to_owned(),
        })
    }

    /// The rounds done so far.
    pub fn rounds(&self) -> &[Round] {
        &self.rounds
    }

    /// Where the model after the last round is.
    pub fn checkpoint(&self) -> PathBuf {
        self.checkpoint_after(self.rounds.len())
    }

    fn checkpoint_after(&self, rounds: usize) -> PathBuf {
        self.dir.join(format!("checkpoint-{rounds:03}"))
    }

    /// The run as it was left, or begun. `dynamics` is what its model file says.
    ///
    /// # Errors
    /// A damaged file, or a plant that diverges.
    pub fn progress(&self, run: &Run<'_>, dynamics: &Dynamics) -> Result<Progress, RunError> {
        let done = self.rounds.len();
        if done == 0 {
            let progress = run.begin()?;
            self.write_stretch(&progress.experience.logs[0], 0)?;
            return Ok(progress);
        }
        let columns = Columns::default();
        let read = |number| Log::read(self.stretch(number), run.task.joints(), &columns);
        let device = run.learner.backend.device();
        let checkpoint = Checkpoint::load(&self.checkpoint())?;
        Ok(Progress {
            experience: Experience {
                logs: (0..=done).map(read).collect::<Result<_, _>>()?,
            },
            model: Some(checkpoint.model(dynamics, &device)?),
            rounds: done,
        })
    }

    /// Keep what a round brought. Its line comes last: without it the round is done again, from the model before it,
    /// which therefore goes only then.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn keep(
        &mut self,
        round: Round,
        progress: &Progress,
        training: &Training,
        origin: &Origin,
    ) -> Result<(), RunError> {
        let logs = &progress.experience.logs;
        self.write_stretch(&logs[logs.len() - 1], logs.len() - 1)?;
        self.rounds.push(round);
        save(&self.checkpoint(), training, origin)?;
        let line = |round| serde_json::to_string(round).expect("numbers and texts") + "\n";
        let lines: String = self.rounds.iter().map(line).collect();
        write_whole(&self.dir.join(ROUNDS), lines.as_bytes())?;
        self.forget_earlier()
    }

    fn forget_earlier(&self) -> Result<(), RunError> {
        let earlier = (1..self.rounds.len()).map(|rounds| self.checkpoint_after(rounds));
        for path in earlier.filter(|path| path.exists()) {
            fs::remove_dir_all(&path).map_err(|error| RunError::Saved {
                message: error.to_string(),
                path,
            })?;
        }
        Ok(())
    }

    fn stretch(&self, number: usize) -> PathBuf {
        self.dir.join(format!("stretch-{number:03}.csv"))
    }

    fn write_stretch(&self, log: &Log, number: usize) -> Result<(), RunError> {
        Ok(log.write(self.stretch(number))?)
    }
}
