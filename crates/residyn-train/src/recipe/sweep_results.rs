use std::collections::BTreeMap;
use std::fmt::Write;

use serde::Serialize;
use serde_json::Value;

use super::{Job, Kind, Member};
use crate::Trained;
use residyn_core::data::statistics::quartiles;

/// The results of a sweep, as written to `sweep.json`. Numbers that are not finite are null there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweepResults {
    pub schema: u32,
    /// Version of the program that wrote it.
    pub residyn: String,
    pub system: String,
    pub kind: Kind,
    /// The resolved recipe, a hash of its data, the device and the command line.
    pub config: Value,
    /// Seed of the data, which all models share.
    pub seed: u64,
    /// Training segments.
    pub segments: usize,
    pub totals: Totals,
    /// Over the models that did not diverge.
    pub error: Option<Quartiles>,
    pub residual_norm: Option<Quartiles>,
    pub parameters: BTreeMap<String, Option<Quartiles>>,
    pub models: Vec<SweptModel>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Totals {
    pub models: usize,
    pub diverged: usize,
    /// Epochs of each model.
    pub epochs: usize,
    /// Time to train all models, one after another or in batches, s.
    pub wall_s: f64,
    pub models_per_s: f64,
}

/// Quartiles of a sample, linearly interpolated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quartiles {
    pub lower: f64,
    pub median: f64,
    pub upper: f64,
}

/// One model of the sweep.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweptModel {
    /// Seed of its initial weights.
    pub seed: u64,
    /// Weight alpha of the penalty, or the initial lambda; none for a model without a residual.
    pub alpha: Option<f64>,
    /// Prediction error on the training segments: mean of ||s' - s_hat'||^2.
    pub error: f64,
    /// ||F_r||; 0 for a model without a residual.
    pub residual_norm: f64,
    pub parameters: BTreeMap<String, f64>,
    pub diverged: bool,
}

impl SweepResults {
    /// Summarises the `trained` models of a sweep of `job`, one per member, whose training took `wall_s` seconds in all.
    pub fn new(job: &Job, members: &[Member], trained: Vec<Trained>, wall_s: f64) -> Self {
        let declared = job.model.declared();
        let fit = &job.recipe.fit;
        let alpha = |member: &Member| member.alpha.unwrap_or(fit.penalty.initial());
        let models = members
            .iter()
            .zip(trained)
            .map(|(member, trained)| SweptModel {
                seed: member.seed,
                alpha: (job.recipe.kind == Kind::Hybrid).then(|| alpha(member)),
                error: trained.error,
                residual_norm: trained.residual_norm,
                parameters: (declared.iter().map(|p| p.name.clone()))
                    .zip(trained.parameters)
                    .collect(),
                diverged: trained.diverged,
            });
        let models: Vec<SweptModel> = models.collect();
        let sound: Vec<&SweptModel> = models.iter().filter(|model| !model.diverged).collect();
        let of =
            |number: &dyn Fn(&SweptModel) -> f64| Quartiles::of(sound.iter().map(|m| number(m)));
        let parameters = declared.iter().map(|p| {
            let name = p.name.clone();
            (name, of(&|model| model.parameters[&p.name]))
        });
        Self {
            schema: 1,
            residyn: env!("CARGO_PKG_VERSION").to_owned(),
            system: job.model.system().to_owned(),
            kind: job.recipe.kind,
            config: config(job),
            seed: job.origin.seed,
            segments: job.data.training.len(),
            totals: Totals {
                models: models.len(),
                diverged: models.len() - sound.len(),
                epochs: fit.epochs,
                wall_s,
                models_per_s: models.len() as f64 / wall_s,
            },
            error: of(&|model| model.error),
            residual_norm: of(&|model| model.residual_norm),
            parameters: parameters.collect(),
            models,
        }
    }

    /// The results as a table for the terminal.
    pub fn text(&self) -> String {
        let Totals {
            models,
            diverged,
            epochs,
            wall_s,
            models_per_s,
        } = self.totals;
        let mut out = format!(
            "{}, {}: {models} models, {epochs} epochs each on {} segments, {diverged} diverged\n  {:<16}  {:>10}  {:>10}  {:>10}\n",
            self.system,
            self.kind.name(),
            self.segments,
            "",
            "quartile",
            "median",
            "quartile"
        );
        let fixed = [
            ("prediction error", self.error),
            ("||F_r||", self.residual_norm),
        ];
        let parameters = self.parameters.iter().map(|(name, q)| (name.as_str(), *q));
        for (name, quartiles) in fixed.into_iter().chain(parameters) {
            if let Some(q) = quartiles {
                let [lower, median, upper] = [q.lower, q.median, q.upper].map(short);
                let _ = writeln!(out, "  {name:<16}  {lower:>10}  {median:>10}  {upper:>10}");
            }
        }
        let _ = writeln!(out, "{wall_s:.1} s, {models_per_s:.3} models per second");
        out
    }
}

fn config(job: &Job) -> Value {
    let mut config = job.origin.config.clone();
    config["command"] = "sweep".into();
    config
}

impl Quartiles {
    /// None for an empty sample.
    fn of(sample: impl Iterator<Item = f64>) -> Option<Self> {
        let sample: Vec<f64> = sample.collect();
        let [lower, median, upper] = (!sample.is_empty()).then(|| quartiles(&sample))?;
        Some(Self {
            lower,
            median,
            upper,
        })
    }
}

fn short(number: f64) -> String {
    if number == 0.0 || (1e-2..1e5).contains(&number.abs()) {
        format!("{number:.5}")
    } else {
        format!("{number:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use super::Quartiles;

    #[test]
    fn an_empty_sample_has_no_quartiles() {
        let of = |sample: &[f64]| Quartiles::of(sample.iter().copied());
        assert_eq!(of(&[]), None);
        let four = of(&[4.0, 1.0, 2.0, 3.0]).unwrap();
        assert_eq!([four.lower, four.median, four.upper], [1.75, 2.5, 3.25]);
    }
}
