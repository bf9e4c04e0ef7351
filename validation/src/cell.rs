//! One cell: record its logs, close the loop, fit the true structure for comparison, judge.

use std::collections::BTreeMap;

use anyhow::{Context, Error, anyhow};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::answer::{answer, label_of};
use super::coverage::Coverage;
use super::draw::Drawn;
use super::grid::{Cell, Group, Simulation, Source};
use super::hidden::{Hidden, Label};
use super::identifiable::Told;
use super::judge::{Answer, Judgement, Truth, judge};
use super::machine::Machine;
use super::mechanics::Pair;
use super::sensors::repeat;
use residyn_core::closeloop::{Outcome, Request, Settings, Split, StudyError, close_loop};
use residyn_core::data::{Log, LogError};
use residyn_core::model::{Library, Model};
use residyn_core::rng;
use residyn_io::files::content_hash;
use residyn_io::read_log;
use residyn_io::read_model;

/// The result of a cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Findings {
    /// Of closing the loop.
    Searched(Box<Searched>),
    /// Of the fit that is given the true structure.
    Told(KnownStructure),
}

/// The result of closing the loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Searched {
    pub truth: Truth,
    pub answer: Answer,
    pub judgement: Judgement,
    pub errors: Errors,
}

/// The result of fitting the true structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KnownStructure {
    pub truth: Truth,
    /// Open-loop position error on the test log, 0.5 s ahead, all joints together \[rad\].
    pub error: f64,
    pub coverage: Vec<Coverage>,
}

/// Open-loop position error on the test log, 0.5 s ahead, all joints together \[rad\].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    pub before: f64,
    pub after: f64,
    /// Of the model with the true effects, fitted to the same logs; `None` if the library lacks one of these effects.
    pub message: Option<f64>,
}

impl Errors {
    /// The error with the effects found, relative to the true structure's.
    pub fn ratio(&self) -> Option<f64> {
        self.message.map(|message| self.after / message)
    }
}

/// All logs but the last for training, the last for the test.
pub fn last_is_test(logs: Vec<Log>) -> Split {
    let mut split = Split::given(logs, Vec::new());
    split.test.extend(split.train.pop());
    split
}

impl Cell {
    /// The cell with its rig drawn, if it has to be drawn.
    ///
    /// # Errors
    /// A model file that cannot be read, or rules by which no rig can be drawn.
    pub fn settled(&self, library: &Library) -> anyhow::Result<Self> {
        let mut rng = rng(content_hash(format!("{}: rig", self.id).as_bytes()));
        let recipe = match &self.source {
            Source::Drawn(recipe) => recipe,
            Source::Arm(arm) => {
                let effects = arm.hidden(&read_model(&self.model, library)?, &mut rng);
                let effects = effects.map_err(|message| anyhow!("{}: {message}", self.id))?;
                return Ok(Self {
                    effects,
                    ..self.clone()
                });
            }
            Source::Robot(robot) => {
                return Ok(Self {
                    effects: robot.hidden(&read_model(&self.model, library)?, &mut rng)?,
                    ..self.clone()
                });
            }
            Source::Simulated(_) | Source::Files { .. } => return Ok(self.clone()),
        };
        let model = read_model(&self.model, library)?;
        let drawn = recipe.settle(self, &model, library, &mut rng)?;
        let mut settled = self.drawn(&drawn, &drawn.effects);
        let (_, truth) = settled.record(&model)?;
        let start = recipe.start(&model, &truth.declared, &mut rng);
        settled.start = start.map_err(Error::msg)?;
        Ok(settled)
    }

    /// Number of joints, if the rig is simulated.
    pub fn joints(&self) -> Option<usize> {
        match &self.source {
            Source::Simulated(simulation) => Some(simulation.mechanics.joints()),
            Source::Drawn(recipe) => Some(recipe.mechanics.joints()),
            Source::Arm(arm) => Some(arm.amplitude.len()),
            Source::Robot(robot) => Some(robot.build.targets.len()),
            Source::Files { .. } => None,
        }
    }

    /// The cell with a drawn rig that has these effects.
    pub(super) fn drawn(&self, drawn: &Drawn, effects: &[Hidden]) -> Self {
        Self {
            effects: effects.to_vec(),
            source: Source::Simulated(Box::new(drawn.simulation.clone())),
            ..self.clone()
        }
    }

    /// The declared model.
    ///
    /// # Errors
    /// A model file that cannot be read.
    pub fn declared(&self, library: &Library) -> anyhow::Result<Model> {
        let mut model = read_model(&self.model, library)?;
        for (name, value) in &self.start {
            let mut parameters = model.parameters.iter_mut();
            let parameter = parameters.find(|parameter| parameter.name == *name);
            let unknown = || format!("{}: no parameter `{name}`", self.model.display());
            parameter.with_context(unknown)?.value = *value;
        }
        Ok(model)
    }

    /// The logs of the cell and the truth behind them.
    ///
    /// # Errors
    /// A file that cannot be read, or a rig that has not been drawn.
    ///
    /// # Panics
    /// Never: the effects were checked when the grid was read.
    pub fn record(&self, model: &Model) -> anyhow::Result<(Vec<Log>, Truth)> {
        match &self.source {
            Source::Files { logs, declared } => {
                let read = |path| read_log(path, model);
                let logs = logs.iter().map(read).collect::<Result<_, LogError>>()?;
                Ok((logs, Truth::of(&self.effects, declared.clone(), &[])))
            }
            Source::Simulated(simulation) => Ok(self.simulate(simulation, &self.hidden(model))),
            Source::Arm(arm) => {
                let logs = arm.record(model, &self.effects, &mut self.rng());
                let logs = logs.map_err(|message| anyhow!("{}: {message}", self.id))?;
                Ok((logs, Truth::of(&self.effects, BTreeMap::new(), &[])))
            }
            Source::Robot(robot) => {
                let logs = robot.record(model, &self.effects, &mut self.rng())?;
                let zeros = vec![self.zeros(model.joints); logs.len()];
                Ok((logs, Truth::of(&self.effects, BTreeMap::new(), &zeros)))
            }
            Source::Drawn(_) => Err(anyhow!("{}: its rig has not been drawn", self.id)),
        }
    }

    fn simulate(&self, simulation: &Simulation, hidden: &[Hidden]) -> (Vec<Log>, Truth) {
        let (driving, condition) = (&simulation.driving, &simulation.condition);
        let machine = Machine::with(simulation.mechanics.clone(), &self.effects)
            .expect("the effects were checked when the grid was read");
        let mut rng = self.rng();
        let offsets: Vec<Pair> = (0..condition.logs)
            .map(|_| self.draw_offset(&mut rng))
            .collect();
        let of_joints: Vec<Vec<f64>> = offsets.iter().map(|offset| offset.to_vec()).collect();
        let truth = Truth::of(hidden, machine.declared(), &of_joints);
        let record = |(index, offset): (usize, &Pair)| {
            machine.record(driving, condition, index, *offset, &mut rng)
        };
        let mut logs: Vec<Log> = offsets.iter().enumerate().map(record).collect();
        logs.iter_mut()
            .for_each(|log| repeat(log, &condition.flaws, &mut rng));
        (logs, truth)
    }

    /// The effects that the model does not declare.
    fn hidden(&self, model: &Model) -> Vec<Hidden> {
        let declared: Vec<Label> = model.effects.iter().map(label_of).collect();
        let hidden = |effect: &&Hidden| !declared.contains(&effect.label());
        self.effects.iter().filter(hidden).cloned().collect()
    }

    /// The cell whose logs are the same but for repeated readings.
    fn without_repeats(&self) -> Self {
        let mut cell = self.clone();
        if let Source::Simulated(simulation) = &mut cell.source {
            simulation.condition.flaws.repeated = 0.0;
        }
        cell
    }

    /// Each cell has its own motion and noise.
    fn rng(&self) -> impl Rng + use<> {
        rng(content_hash(self.id.as_bytes()))
    }

    /// How far each sensor of a robot is off, in all of its logs \[rad\].
    fn zeros(&self, joints: usize) -> Vec<f64> {
        let mut zeros = vec![0.0; joints];
        let of_sensors = self.effects.iter();
        for effect in of_sensors.filter(|effect| effect.name == "sensor_offset") {
            zeros[effect.joint] = effect.values["q_z"];
        }
        zeros
    }

    fn draw_offset(&self, rng: &mut impl Rng) -> Pair {
        let mut offset = [0.0; 2];
        for effect in &self.effects {
            if effect.name == "sensor_offset" {
                offset[effect.joint] = effect.values["q_z"] * rng.random_range(-1.0..=1.0);
            }
        }
        offset
    }

    /// Record the logs, close the loop or fit the given structure, judge.
    ///
    /// # Errors
    /// A model file or log that cannot be read, or logs on which closing the loop fails.
    pub fn run(&self, library: &Library) -> anyhow::Result<Findings> {
        let model = self.declared(library)?;
        let (logs, mut truth) = self.record(&model)?;
        let split = last_is_test(logs);
        let settings = Settings::default();
        let (effects, known) = (&self.hidden(&model), &truth.declared);
        // Rigs of many joints are compared by torques, which this fit does not handle.
        let message = match self.source {
            Source::Arm(_) | Source::Robot(_) => None,
            _ => Told::fit(&model, library, &split, &settings, effects, known),
        };
        if self.group == Group::Told {
            let message = message.context("the true structure cannot be fitted")?;
            return Ok(Findings::Told(KnownStructure {
                error: message.error(),
                coverage: message.coverage(&truth)?,
                truth,
            }));
        }
        if self.group == Group::Several {
            truth.twins = message.as_ref().map(Told::twins).unwrap_or_default();
        }
        if self.group == Group::Repeated {
            let (logs, _) = self.without_repeats().record(&model)?;
            let outcome = close(&model, library, last_is_test(logs), self.seed)?;
            truth.effects = without_sizes(&answer(&outcome));
        }
        let outcome = close(&model, library, split.clone(), self.seed)?;
        let answer = answer(&outcome);
        Ok(Findings::Searched(Box::new(Searched {
            judgement: judge(self.group, &truth, &answer),
            errors: Errors {
                before: outcome.errors.before.position_rms(),
                after: outcome.errors.after.position_rms(),
                message: message.map(|message| message.error()),
            },
            truth,
            answer,
        })))
    }
}

/// What an answer names.
fn without_sizes(answer: &Answer) -> Vec<(Label, BTreeMap<String, f64>)> {
    let named = answer.named.iter();
    named
        .map(|named| (named.label.clone(), BTreeMap::new()))
        .collect()
}

/// The method under test.
fn close(model: &Model, library: &Library, split: Split, seed: u64) -> Result<Outcome, StudyError> {
    let request = Request::new(model, library, split);
    close_loop(request, &mut rng(seed), &())
}
