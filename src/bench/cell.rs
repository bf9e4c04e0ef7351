//! One cell: record its logs, close the loop, fit the true structure for comparison, judge.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::answer::answer;
use super::grid::{Cell, Simulation, Source};
use super::judge::{Answer, Judgement, Truth, judge};
use super::machine::Machine;
use super::mechanics::Pair;
use super::told::told;
use crate::closeloop::{Outcome, Request, Split, StudyError, close_loop};
use crate::data::{Log, LogError};
use crate::files::content_hash;
use crate::model::{Library, Model};

/// The result of a cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    pub truth: Truth,
    pub answer: Answer,
    pub judgement: Judgement,
    pub errors: Errors,
}

/// Open-loop position error on the test log, 0.5 s ahead, all joints together \[rad\].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    pub before: f64,
    pub after: f64,
    /// Of the model with the true effects, fitted to the same logs; `None` where the library lacks one of them.
    pub told: Option<f64>,
}

impl Errors {
    /// How the error with the effects found compares with that of the true structure.
    pub fn ratio(&self) -> Option<f64> {
        self.told.map(|told| self.after / told)
    }
}

impl Cell {
    /// The logs of the cell and the truth behind them.
    ///
    /// # Errors
    /// A file that cannot be read.
    ///
    /// # Panics
    /// Never: the effects were checked when the grid was read.
    pub fn record(&self, model: &Model) -> Result<(Vec<Log>, Truth), LogError> {
        match &self.source {
            Source::Files { logs, declared } => {
                let read = |path| model.read_log(path);
                let logs = logs.iter().map(read).collect::<Result<_, _>>()?;
                Ok((logs, Truth::of(&self.effects, declared.clone(), &[])))
            }
            Source::Simulated(simulation) => Ok(self.simulate(simulation)),
        }
    }

    fn simulate(&self, simulation: &Simulation) -> (Vec<Log>, Truth) {
        let (driving, condition) = (&simulation.driving, &simulation.condition);
        let machine = Machine::with(simulation.mechanics.clone(), &self.effects)
            .expect("the effects were checked when the grid was read");
        // Cells share neither their motions nor their noise.
        let mut rng = ChaCha8Rng::seed_from_u64(content_hash(self.id.as_bytes()));
        let offsets: Vec<Pair> = (0..condition.logs)
            .map(|_| self.draw_offset(&mut rng))
            .collect();
        let truth = Truth::of(&self.effects, machine.declared(), &offsets);
        let record = |(index, offset): (usize, &Pair)| {
            machine.record(driving, condition, index, *offset, &mut rng)
        };
        (offsets.iter().enumerate().map(record).collect(), truth)
    }

    fn draw_offset(&self, rng: &mut ChaCha8Rng) -> Pair {
        let mut offset = [0.0; 2];
        for effect in &self.effects {
            if effect.name == "sensor_offset" {
                offset[effect.joint] = effect.values["q_z"] * rng.random_range(-1.0..=1.0);
            }
        }
        offset
    }

    /// Record the logs, close the loop, judge.
    ///
    /// # Errors
    /// A model file or log that cannot be read, or logs on which closing the loop fails.
    pub fn run(&self, library: &Library) -> anyhow::Result<Findings> {
        let model = library.model(&self.model)?;
        let (logs, truth) = self.record(&model)?;
        let mut split = Split::given(logs, Vec::new());
        split.test.extend(split.train.pop());
        let outcome = close(&model, library, split.clone(), self.seed)?;
        let answer = answer(&outcome);
        Ok(Findings {
            judgement: judge(self.group, &truth, &answer),
            errors: Errors {
                before: outcome.errors.before.position_rms(),
                after: outcome.errors.after.position_rms(),
                told: told(&model, library, &split, &self.effects),
            },
            truth,
            answer,
        })
    }
}

/// What is tested.
fn close(model: &Model, library: &Library, split: Split, seed: u64) -> Result<Outcome, StudyError> {
    let request = Request::new(model, library, split);
    close_loop(request, &mut ChaCha8Rng::seed_from_u64(seed), &mut |_| ())
}
