//! One cell: simulate, close the loop, fit what a person who knew the truth would, judge.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::grid::{Cell, hash};
use super::hidden::Hidden;
use super::judge::{Answer, Estimate, Judgement, Label, Named, Truth, judge, label};
use super::machine::Machine;
use crate::closeloop::{Finding, Outcome, Request, Split, Study, StudyError, close_loop};
use crate::data::Log;
use crate::evaluate::{Assessment, assess};
use crate::model::{FittedEffect, Library, Parameter, System};

/// Errors are compared at the middle one \[s\].
const HORIZONS_S: [f64; 3] = [0.1, 0.5, 1.0];

/// What came of a cell.
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
    /// Of the model with the true effects, fitted to the same logs; none where the library lacks one.
    pub told: Option<f64>,
}

impl Errors {
    /// How the error with the effects found compares with that of the true structure.
    pub fn ratio(&self) -> Option<f64> {
        self.told.map(|told| self.after / told)
    }
}

impl Cell {
    /// The logs of the cell, and how much its encoders read too much in each \[log\]\[joint\].
    ///
    /// # Panics
    /// Never: the effects were checked when the grid was read.
    pub fn record(&self) -> (Vec<Log>, Vec<[f64; 2]>) {
        let machine = Machine::with(self.bench.mechanics.clone(), &self.effects)
            .expect("the effects were checked when the grid was read");
        // Cells share neither their motions nor their noise.
        let mut rng = ChaCha8Rng::seed_from_u64(hash(self.id.as_bytes()));
        let offsets: Vec<[f64; 2]> = (0..self.condition.logs)
            .map(|_| self.draw_offset(&mut rng))
            .collect();
        let record = |(index, offset): (usize, &[f64; 2])| {
            let (driving, condition) = (&self.bench.driving, &self.condition);
            machine.record(driving, condition, index, *offset, &mut rng)
        };
        let logs = offsets.iter().enumerate().map(record).collect();
        (logs, offsets)
    }

    fn draw_offset(&self, rng: &mut ChaCha8Rng) -> [f64; 2] {
        let mut offset = [0.0; 2];
        for effect in &self.effects {
            if effect.name == "sensor_offset" {
                offset[effect.joint - 1] = effect.values["q_z"] * rng.random_range(-1.0..=1.0);
            }
        }
        offset
    }

    /// Simulate, close the loop, judge.
    ///
    /// # Errors
    /// A model file that cannot be read, or logs from which the loop cannot be closed.
    pub fn run(&self, library: &Library) -> anyhow::Result<Findings> {
        let system = library.system(Path::new(&self.bench.model))?;
        let (logs, offsets) = self.record();
        let truth = Truth::of(self, &offsets);
        let mut split = Split::given(logs, Vec::new());
        split.test.extend(split.train.pop());
        let outcome = close(&system, library, split.clone(), self.seed)?;
        let answer = answer(&outcome);
        Ok(Findings {
            judgement: judge(self.group, &truth, &answer),
            errors: Errors {
                before: outcome.errors.before.position_rms(),
                after: outcome.errors.after.position_rms(),
                told: told(&system, library, &split, &self.effects),
            },
            truth,
            answer,
        })
    }
}

/// The thing that is measured.
fn close(
    system: &System,
    library: &Library,
    split: Split,
    seed: u64,
) -> Result<Outcome, StudyError> {
    let request = Request {
        system,
        library,
        split,
        horizons_s: HORIZONS_S,
        against: Vec::new(),
        backend: None,
    };
    close_loop(request, &mut ChaCha8Rng::seed_from_u64(seed), &mut |_| ())
}

fn answer(outcome: &Outcome) -> Answer {
    let of_effects: Vec<&str> = outcome
        .findings
        .iter()
        .flat_map(|finding| &finding.parameters)
        .map(|parameter| parameter.name.as_str())
        .collect();
    let is_declared = |parameter: &&Parameter| !of_effects.contains(&parameter.name.as_str());
    let set = |effects: &[FittedEffect]| effects.iter().map(label_of).collect();
    Answer {
        verdict: outcome.verdict,
        reason: outcome.reason.clone(),
        named: outcome.findings.iter().map(named).collect(),
        alternatives: outcome
            .alternatives
            .iter()
            .map(|alternative| set(&alternative.effects))
            .collect(),
        declared: outcome
            .parameters
            .iter()
            .filter(is_declared)
            .map(|parameter| estimate(&parameter.name, parameter))
            .collect(),
        left: outcome.unexplained.fraction,
        left_p_value: outcome.unexplained.p_value,
        left_where: outcome.unexplained.place.clone(),
    }
}

fn named(finding: &Finding) -> Named {
    let own = finding.effect.effect.parameters.iter();
    let estimates = own.zip(&finding.parameters);
    Named {
        label: label_of(&finding.effect),
        parameters: estimates
            .map(|(own, found)| estimate(&own.name, found))
            .collect(),
        p_value: finding.p_value,
        error_reduction: finding.error_reduction,
    }
}

fn label_of(effect: &FittedEffect) -> Label {
    label(&effect.effect.name, effect.joint + 1, "")
}

fn estimate(name: &str, parameter: &Parameter) -> Estimate {
    Estimate {
        name: name.to_owned(),
        value: parameter.value,
        ci95: parameter.ci95,
    }
}

/// Error of the model with the true effects, fitted from their true values to the logs that the search had.
fn told(system: &System, library: &Library, split: &Split, effects: &[Hidden]) -> Option<f64> {
    let mut study = Study::new(system, &split.train);
    let declared = study.fit_declared().ok()?;
    let truth: Vec<FittedEffect> = effects
        .iter()
        .map(|hidden| fitted(&study, library, hidden))
        .collect::<Option<_>>()?;
    let locals = declared.fit.locals.clone();
    let model = study.refit(&truth, &declared.declared, locals, None).ok()?;
    let values = |_| model.fit.values.as_slice();
    let errors: Assessment = assess(&model.dynamics, values, &split.test, &HORIZONS_S);
    Some(errors.position_rms())
}

/// The library's effect of that name with the true values; none where it has no such effect.
fn fitted(study: &Study<'_>, library: &Library, hidden: &Hidden) -> Option<FittedEffect> {
    let joint = hidden.joint - 1;
    let effect = library.effect(&hidden.name).ok()?;
    let effect = effect.measured_by(study.top_speed[joint], study.top_torque[joint]);
    let mut fitted = FittedEffect::absent(&effect, joint);
    for (slot, parameter) in fitted.values.iter_mut().zip(&effect.parameters) {
        slot.0 = *hidden.values.get(&parameter.name)?;
    }
    Some(fitted)
}
