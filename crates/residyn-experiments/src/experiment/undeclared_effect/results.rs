use std::fmt::Write;

use serde::Serialize;

use super::{Case, Closed, Experiment, PlanningModel, Trial};
use residyn_core::data::statistics::{bootstrap, mean, sample_deviation};
use residyn_core::streams::{Purpose, stream};
use residyn_plot::Share;

/// The share of the lost return that is to be recovered after the first number of episodes.
pub const TARGET: f64 = 0.9;

/// The results of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Results {
    pub schema: u32,
    /// Version of the program that wrote it.
    pub residyn: String,
    pub config: Experiment,
    pub target: f64,
    /// Whether the target is reached in every case with a loss.
    pub reached: bool,
    pub cases: Vec<CaseResults>,
}

/// The results for one plant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CaseResults {
    pub case: Case,
    /// Return with the true model minus return with the declared one, mean over the seeds.
    pub loss: f64,
    pub loss_ci95: [f64; 2],
    /// Whether the loss is significant. If it is not, there is nothing to win back.
    pub is_lost: bool,
    pub models: Vec<Compared>,
    pub seeds: Vec<u64>,
    /// What closing the loop found: `[seed][number of episodes]`.
    pub closed: Vec<Vec<Closed>>,
}

/// The returns of a model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    pub model: PlanningModel,
    /// Number of episodes that it was fitted to.
    pub episodes: usize,
    /// One per seed.
    pub returns: Vec<f64>,
    pub mean: f64,
    pub deviation: f64,
    /// Number of episodes in which the goal was held until the end.
    pub successes: usize,
    /// None for the declared and the true model, and if nothing is lost.
    pub won_back: Option<Recovered>,
}

/// The share of the lost return that a model wins back.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Recovered {
    /// Ratio of means over the seeds; 1 if the whole loss is won back.
    pub share: f64,
    pub ci95: [f64; 2],
}

impl Results {
    pub(super) fn new(experiment: &Experiment, trials: &[Trial]) -> Self {
        let of_case = |case: &Case| {
            let own: Vec<&Trial> = trials.iter().filter(|t| t.case == case.name).collect();
            CaseResults::new(case, &own)
        };
        let cases: Vec<CaseResults> = experiment.cases.iter().map(of_case).collect();
        let first = experiment.episodes[0];
        Self {
            schema: 1,
            residyn: env!("CARGO_PKG_VERSION").to_owned(),
            config: experiment.clone(),
            target: TARGET,
            reached: cases
                .iter()
                .filter_map(|case| case.share(first))
                .all(|share| share >= TARGET),
            cases,
        }
    }

    /// The answer in a sentence.
    pub fn headline(&self) -> String {
        let verdict = if self.reached { "reached" } else { "missed" };
        format!(
            "target: {:.0} % of the lost return won back after {} episode(s) in every case: {verdict}",
            100.0 * TARGET,
            self.config.episodes[0]
        )
    }

    /// The share of the lost return that each learning model wins back.
    pub fn shares(&self) -> Vec<Share> {
        let share = |case: &CaseResults, model: &Compared| {
            let Recovered { share, ci95 } = model.won_back?;
            Some(Share {
                what: format!("{}: won back by {}", case.case.name, model.name()),
                share,
                interval: ci95,
            })
        };
        let cases = self.cases.iter();
        cases
            .flat_map(|case| case.models.iter().filter_map(|model| share(case, model)))
            .collect()
    }

    /// The results as tables in Markdown.
    pub fn text(&self) -> String {
        let mut out = String::new();
        for case in &self.cases {
            case.write(&mut out);
        }
        out + &self.headline() + "\n"
    }
}

impl CaseResults {
    fn new(case: &Case, trials: &[&Trial]) -> Self {
        let mut models: Vec<Compared> = (0..trials[0].scores.len())
            .map(|k| Compared::new(trials, k))
            .collect();
        let declared = models[0].returns.clone();
        let truth = models[models.len() - 1].returns.clone();
        let of = |returns: &[f64], drawn: &[usize]| -> f64 {
            drawn
                .iter()
                .map(|&seed| returns[seed] - declared[seed])
                .sum()
        };
        let mut rng = stream(0, Purpose::Other(0));
        let (seeds, all) = (trials.len(), (0..trials.len()).collect::<Vec<_>>());
        let per_seed = 1.0 / seeds as f64;
        let loss_ci95 = bootstrap(seeds, &mut rng, |drawn| per_seed * of(&truth, drawn));
        let is_lost = loss_ci95[0] > 0.0;
        let learnt = models
            .iter_mut()
            .filter(|model| is_lost && model.episodes > 0);
        for model in learnt {
            let share = |drawn: &[usize]| of(&model.returns, drawn) / of(&truth, drawn);
            model.won_back = Some(Recovered {
                share: share(&all),
                ci95: bootstrap(seeds, &mut rng, share),
            });
        }
        Self {
            case: case.clone(),
            loss: per_seed * of(&truth, &all),
            loss_ci95,
            is_lost,
            models,
            seeds: trials.iter().map(|trial| trial.seed).collect(),
            closed: trials.iter().map(|trial| trial.closed.clone()).collect(),
        }
    }

    /// The share that the closed model wins back after this number of episodes; `None` if nothing is lost.
    fn share(&self, episodes: usize) -> Option<f64> {
        let is_it = |m: &&Compared| m.model == PlanningModel::Closed && m.episodes == episodes;
        let model = self.models.iter().find(is_it)?;
        model.won_back.map(|won| won.share)
    }

    fn write(&self, out: &mut String) {
        let [low, high] = self.loss_ci95;
        let lost = if self.is_lost {
            ""
        } else {
            ", which is not significant: nothing to win back"
        };
        let _ = writeln!(
            out,
            "{}: the declared model loses {:.1} ({low:.1} to {high:.1}){lost}\n\n\
             | model | return | goal held | won back |\n|---|---|---|---|",
            self.case.name, self.loss
        );
        for model in &self.models {
            model.write(out);
        }
        out.push('\n');
        for (seed, closed) in self.seeds.iter().zip(&self.closed) {
            for found in closed {
                found.write(out, *seed);
            }
        }
        out.push('\n');
    }
}

impl Compared {
    /// Collects the k-th model of every trial.
    fn new(trials: &[&Trial], k: usize) -> Self {
        let scores = || trials.iter().map(|trial| &trial.scores[k]);
        let returns: Vec<f64> = scores().map(|score| score.episode.total).collect();
        let first = &trials[0].scores[k];
        Self {
            model: first.model,
            episodes: first.episodes,
            mean: mean(&returns),
            deviation: sample_deviation(&returns),
            successes: scores().filter(|score| score.episode.success).count(),
            won_back: None,
            returns,
        }
    }

    /// The model, with the number of episodes it learnt from.
    fn name(&self) -> String {
        match self.episodes {
            0 => self.model.name().to_owned(),
            episodes => format!("{}, {episodes} episode(s)", self.model.name()),
        }
    }

    fn write(&self, out: &mut String) {
        let won = self.won_back.map(|Recovered { share, ci95 }| {
            let [share, low, high] = [share, ci95[0], ci95[1]].map(|x| 100.0 * x);
            format!("{share:.0} % ({low:.0} to {high:.0})")
        });
        let _ = writeln!(
            out,
            "| {:<24} | {:>8.1} +- {:<6.1} | {} of {} | {} |",
            self.name(),
            self.mean,
            self.deviation,
            self.successes,
            self.returns.len(),
            won.unwrap_or_default()
        );
    }
}

impl Closed {
    fn write(&self, out: &mut String, seed: u64) {
        let values = |values: &[(String, f64)]| {
            let each = values
                .iter()
                .map(|(name, value)| format!("{name} {value:.4}"));
            each.collect::<Vec<_>>().join(", ")
        };
        let named = self.effects.iter().map(|effect| {
            let (name, joint) = (&effect.name, effect.joint);
            format!("{name}@{joint} ({})", values(&effect.parameters))
        });
        let named: Vec<String> = named.collect();
        let named = if named.is_empty() {
            "no effect".to_owned()
        } else {
            named.join(", ")
        };
        let _ = writeln!(
            out,
            "- seed {seed}, {} episode(s): {named}; {}",
            self.episodes,
            values(&self.parameters)
        );
    }
}
