use std::collections::BTreeMap;
use std::fmt::Write;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::mbrl::EpisodeScore;
use residyn_core::data::statistics::{mean, sample_deviation};

/// The method that plans with the plant's own equations.
pub const PERFECT: &str = "perfect";
/// The method that plans with the prior and does not learn.
pub const PRIOR: &str = "prior";

/// The fraction of the perfect model's return that counts as reached.
const REACHED: f64 = 0.9;

/// The results of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Results {
    pub schema: u32,
    pub experiment: String,
    pub task: String,
    pub seeds: Vec<u64>,
    /// The receding horizons (executed steps of each plan) that the entries of the methods stand for, if they do not
    /// stand for amounts of data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receding_horizon: Option<Vec<usize>>,
    pub methods: BTreeMap<String, Course>,
    /// How far each learning method came.
    pub reached: BTreeMap<String, Reached>,
    /// The whole configuration, as resolved.
    pub config: Value,
    pub version: String,
    /// Total time over all interruptions, s; measured by the caller.
    pub wall_s: f64,
    pub command: String,
}

/// A method's return, one entry for each amount of data or each receding horizon.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Course {
    /// Number of real transitions that its model was trained on.
    pub transitions: Vec<usize>,
    pub return_mean: Vec<f64>,
    /// Sample standard deviation over the seeds.
    pub return_std: Vec<f64>,
    /// `[entry][seed]`
    pub returns: Vec<Vec<f64>>,
    /// Whether the goal of the task was held until the end: `[entry][seed]`.
    pub success: Vec<Vec<bool>>,
}

/// How far a method came.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// Smallest number of transitions with a mean return of 90 % of the perfect model's; none if not reached.
    pub transitions_to_90_percent: Option<usize>,
    /// Its final mean return, as a fraction of the perfect model's.
    pub final_share_of_perfect: Option<f64>,
    /// Number of seeds whose last episode is a success.
    pub final_successes: usize,
    /// Number of seeds whose final return is higher than that of the prior without learning; none without a prior.
    pub seeds_above_prior: Option<usize>,
}

impl Results {
    pub(super) fn new(experiment: &str, task: &str, seeds: Vec<u64>, config: Value) -> Self {
        Self {
            schema: 1,
            experiment: experiment.to_owned(),
            task: task.to_owned(),
            seeds,
            receding_horizon: None,
            methods: BTreeMap::new(),
            reached: BTreeMap::new(),
            config,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            wall_s: 0.0,
            command: String::new(),
        }
    }

    /// Completes the results of `command`, which took `wall_s` seconds.
    #[must_use]
    pub fn finished(mut self, command: String, wall_s: f64) -> Self {
        let learnt = self
            .methods
            .iter()
            .filter(|(name, _)| ![PRIOR, PERFECT].contains(&name.as_str()));
        self.reached = learnt
            .map(|(name, course)| (name.clone(), self.reached(course)))
            .collect();
        self.command = command;
        self.wall_s = wall_s;
        self
    }

    fn reached(&self, course: &Course) -> Reached {
        let perfect = self
            .methods
            .get(PERFECT)
            .map(|perfect| perfect.return_mean[0]);
        let entries = course.transitions.iter().zip(&course.return_mean);
        let is_enough = |mean: f64| perfect.is_some_and(|perfect| mean >= REACHED * perfect);
        let mut enough = entries.filter(|(_, mean)| is_enough(**mean));
        let last = course.returns.len() - 1;
        let above = |prior: &Course| {
            let pairs = course.returns[last].iter().zip(&prior.returns[0]);
            pairs.filter(|(mine, prior)| mine > prior).count()
        };
        Reached {
            transitions_to_90_percent: match self.receding_horizon {
                Some(_) => None,
                None => enough.next().map(|(transitions, _)| *transitions),
            },
            final_share_of_perfect: perfect.map(|perfect| course.return_mean[last] / perfect),
            final_successes: course.successes(last),
            seeds_above_prior: self.methods.get(PRIOR).map(above),
        }
    }

    /// The answer in a sentence.
    pub fn headline(&self) -> String {
        let (what, message): (_, Vec<String>) = match &self.receding_horizon {
            Some(horizons) => {
                let best = |name: &String| format!("{name} {}", self.methods[name].best(horizons));
                let what = "receding horizon with the highest return, in steps".to_owned();
                (what, self.reached.keys().map(best).collect())
            }
            None if !self.methods.contains_key(PERFECT) => {
                let last = |name: &String| {
                    let returns = &self.methods[name].return_mean;
                    format!("{name} {:.1}", returns[returns.len() - 1])
                };
                (
                    "return at the end".to_owned(),
                    self.reached.keys().map(last).collect(),
                )
            }
            None => {
                let after = |(name, reached): (&String, &Reached)| {
                    format!("{name} {}", self.after(name, reached))
                };
                let share = 100.0 * REACHED;
                let what = format!("{share:.0} % of the return with the plant's equations");
                (what, self.reached.iter().map(after).collect())
            }
        };
        format!("{what}: {}", message.join(", "))
    }

    /// After how much data a method reached the required fraction.
    fn after(&self, name: &str, reached: &Reached) -> String {
        match reached.transitions_to_90_percent {
            Some(transitions) => format!("after {transitions} transitions"),
            None => {
                let all = self.methods[name].transitions.last();
                format!("not within {}", all.copied().unwrap_or_default())
            }
        }
    }

    /// The results as tables in Markdown.
    pub fn text(&self) -> String {
        let mut out = format!(
            "{}, {}, {} seeds\n\n",
            self.experiment,
            self.task,
            self.seeds.len()
        );
        match &self.receding_horizon {
            Some(horizons) => self.table_of_horizons(horizons, &mut out),
            None => self.table_of_learning(&mut out),
        }
        let _ = writeln!(out, "\n{:.0} s: `{}`", self.wall_s, self.command);
        out
    }

    fn table_of_learning(&self, out: &mut String) {
        out.push_str(
            "| method | return at the end | upright | of perfect | 90 % of it |\n|---|---|---|---|---|\n",
        );
        for (name, course) in &self.methods {
            let last = course.returns.len() - 1;
            let (share, after) = match self.reached.get(name) {
                Some(reached) if let Some(share) = reached.final_share_of_perfect => {
                    (format!("{share:.3}"), self.after(name, reached))
                }
                _ => Default::default(),
            };
            let _ = writeln!(
                out,
                "| {name:<22} | {} | {share:>5} | {after} |",
                course.entry(last)
            );
        }
    }

    fn table_of_horizons(&self, horizons: &[usize], out: &mut String) {
        for (name, course) in &self.methods {
            let _ = writeln!(
                out,
                "\n{name}, after {} transitions\n\n| receding horizon | return | upright |\n|---|---|---|",
                course.transitions[0]
            );
            for (entry, horizon) in horizons.iter().enumerate() {
                let _ = writeln!(out, "| {horizon:>4} | {} |", course.entry(entry));
            }
        }
    }
}

impl Course {
    fn successes(&self, entry: usize) -> usize {
        let seeds = self.success[entry].iter();
        seeds.filter(|success| **success).count()
    }

    /// The receding horizon with the highest mean return.
    fn best(&self, horizons: &[usize]) -> usize {
        let entries = horizons.iter().zip(&self.return_mean);
        let best = entries.max_by(|a, b| a.1.total_cmp(b.1));
        best.map_or(0, |(horizon, _)| *horizon)
    }

    /// Return and successes, two cells of a table.
    fn entry(&self, entry: usize) -> String {
        let upright = self.successes(entry);
        let seeds = self.success[entry].len();
        let (mean, std) = (self.return_mean[entry], self.return_std[entry]);
        format!("{mean:>9.1} +- {std:>6.1} | {upright:>3}/{seeds:<3}")
    }
}

/// Collects entries: the number of transitions and the result of each seed.
impl FromIterator<(usize, Vec<EpisodeScore>)> for Course {
    fn from_iter<I: IntoIterator<Item = (usize, Vec<EpisodeScore>)>>(entries: I) -> Self {
        let mut course = Self::default();
        for (transitions, score) in entries {
            let returns: Vec<f64> = score.iter().map(|score| score.total).collect();
            course.transitions.push(transitions);
            course.return_mean.push(mean(&returns));
            course.return_std.push(sample_deviation(&returns));
            course.returns.push(returns);
            course
                .success
                .push(score.iter().map(|score| score.success).collect());
        }
        course
    }
}
