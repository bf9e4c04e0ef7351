use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{Job, Kind};
use crate::{HybridModel, Objective, Segments, TrainError, Training};

/// A prediction error that grew by this factor is not due to rounding or to a penalty.
const WORSE: f64 = 2.0;

/// The results of a training.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrainingResults {
    pub schema: u32,
    pub system: String,
    pub kind: Kind,
    pub epochs: usize,
    /// Training segments.
    pub segments: usize,
    /// Final value of the objective.
    pub loss: f64,
    /// Prediction error on the training segments: mean of ||s' - s_hat'||^2.
    pub error: Change,
    /// Prediction error on test segments of the plant; none with logs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub test_error: Option<Change>,
    /// ||F_r||; 0 for a model without a residual.
    pub residual_norm: Change,
    pub parameters: Vec<FittedParameter>,
    pub checkpoint: PathBuf,
}

/// A quantity before and after training.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Change {
    pub before: f64,
    pub after: f64,
}

/// A physical parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedParameter {
    pub name: String,
    pub unit: String,
    pub start: f64,
    pub found: f64,
    /// True value, if the plant is simulated.
    #[serde(rename = "true", skip_serializing_if = "Option::is_none")]
    pub truth: Option<f64>,
    /// Whether it was held at its initial value.
    pub held: bool,
}

impl Job {
    /// The results of a training of this job, whose checkpoint is in `dir`.
    ///
    /// # Errors
    /// Settings that do not match the model, so that the test error cannot be computed.
    pub fn results(&self, training: &Training, dir: &Path) -> Result<TrainingResults, TrainError> {
        let model = training.result()?;
        let history = training.history();
        let (first, last) = (
            history.first().expect("a run records its start"),
            history.last().expect("a run records its end"),
        );
        let test_error = match &self.data.test {
            Some(test) => Some(Change {
                before: error_on(&self.model, training, test)?,
                after: error_on(&model, training, test)?,
            }),
            None => None,
        };
        Ok(TrainingResults {
            schema: 1,
            system: model.system().to_owned(),
            kind: self.recipe.kind,
            epochs: training.epoch(),
            segments: self.data.training.len(),
            loss: last.loss,
            error: Change {
                before: first.error,
                after: last.error,
            },
            test_error,
            residual_norm: Change {
                before: first.residual_norm,
                after: last.residual_norm,
            },
            parameters: self.fitted(&model),
            checkpoint: dir.to_owned(),
        })
    }

    fn fitted(&self, model: &HybridModel) -> Vec<FittedParameter> {
        let truth = |name: &str| self.data.truth.iter().find(|(known, _)| known == name);
        (self.model.declared().into_iter().zip(model.declared()))
            .map(|(start, found)| FittedParameter {
                truth: truth(&found.name).map(|(_, value)| *value),
                name: found.name,
                unit: found.unit,
                start: start.value,
                found: found.value,
                held: found.fixed,
            })
            .collect()
    }
}

/// The prediction error of a model with the objective of a run.
fn error_on(model: &HybridModel, run: &Training, segments: &Segments) -> Result<f64, TrainError> {
    let settings = run.settings();
    let scale = settings.error_scale.as_deref();
    let objective = Objective::new(settings.integrator, scale, model.joints())?;
    let batch = objective.all(segments, &model.device());
    let [error, _] = objective.evaluate(model, &batch);
    Ok(error)
}

impl TrainingResults {
    /// The results as a table for the terminal.
    pub fn text(&self) -> String {
        let mut out = format!(
            "{}, {}: {} epochs on {} segments\n",
            self.system,
            self.kind.name(),
            self.epochs,
            self.segments
        );
        let _ = writeln!(out, "  loss              {:.4e}", self.loss);
        let mut change = |name: &str, change: Change| {
            let Change { before, after } = change;
            let _ = writeln!(out, "  {name:<16}  {before:.4e} -> {after:.4e}");
        };
        change("prediction error", self.error);
        if let Some(test) = self.test_error {
            change("on other data", test);
        }
        change("||F_r||", self.residual_norm);
        self.parameter_lines(&mut out);
        let _ = writeln!(out, "checkpoint: {}", self.checkpoint.display());
        out
    }

    /// Whether training made the prediction error several times as large, so that the result is useless.
    pub fn is_worse(&self) -> bool {
        self.error.after > WORSE * self.error.before
    }

    fn parameter_lines(&self, out: &mut String) {
        for p in &self.parameters {
            let _ = write!(out, "  {:<16}  {:.6} -> {:.6}", p.name, p.start, p.found);
            if !p.unit.is_empty() {
                let _ = write!(out, " {}", p.unit);
            }
            if let Some(truth) = p.truth {
                let _ = write!(out, " (true: {truth})");
            }
            out.push_str(if p.held { ", held\n" } else { "\n" });
        }
    }
}
