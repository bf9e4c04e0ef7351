//! How closing the loop compares with the alternatives, rig by rig.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::errors::{LogErrors, Squares};
use super::fold::{Fold, Measured};
use super::method::{Found, Method, Said, Scored};
use residyn_core::closeloop::{Settings, Verdict};
use residyn_core::data::statistics::median;

/// The result of a method in a fold, with its run time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Line {
    pub rig: String,
    pub fold: String,
    pub method: Method,
    /// Fingerprint of everything that the numbers depend on: see [`Method::fingerprint`].
    pub fingerprint: String,
    pub seconds: f64,
    /// An error counts as a failure wherever the method counts.
    pub found: Result<Found, String>,
}

/// A row of the table: the folds of a rig that leave logs out, or a group of other test logs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    pub rig: String,
    pub group: Option<String>,
    /// Number of fits that were scored on the row's test logs.
    pub folds: usize,
    pub models: Vec<Entry>,
    /// The best of the other models (usual friction, plain structure, published sets, mujoco.sysid), and its error.
    pub best: Option<(String, f64)>,
    /// Error after closing the loop, divided by the best other error.
    pub ratio: Option<f64>,
    /// Error with the residual network, divided by the error after closing the loop.
    pub hybrid_ratio: Option<f64>,
    /// Effects and verdicts, each with the number of folds.
    pub named: BTreeMap<String, usize>,
    pub verdicts: BTreeMap<String, usize>,
    /// Run time of closing the loop in a fold \[s\]: median over the folds in which it was run.
    pub seconds: Option<f64>,
}

/// The error of a model in a row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Entry {
    pub model: String,
    /// Number of folds without this model, since its fit failed.
    pub failed: usize,
    /// Number of folds in which the method was not run.
    pub missing: usize,
    /// Over all test logs of the folds that did not fail.
    pub pooled: Vec<Horizon>,
    /// Over each test log.
    pub logs: Vec<(String, Vec<Horizon>)>,
}

/// Open-loop position error at a horizon.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Horizon {
    pub horizon_s: f64,
    /// Root mean square over all rows of all windows and all joints \[rad\]; null without a window.
    pub position_rms: f64,
    /// Median over the windows of each window's root mean square \[rad\].
    pub position_median: f64,
    pub windows: usize,
    pub diverged: usize,
}

/// A fold: the error after closing the loop beside those of simpler models.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    pub rig: String,
    pub fold: String,
    /// \[rad\], at the horizon of the table.
    pub after: f64,
    pub simpler: Vec<Simpler>,
}

/// A simpler model in a fold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Simpler {
    pub model: String,
    /// \[rad\]
    pub error: f64,
    /// By how many standard errors the error after closing the loop is larger: see [`Squares::above`].
    pub above: f64,
}

impl Simpler {
    /// Whether closing the loop made the model worse than this one by more than noise: one-sided, 5 %.
    pub fn is_better(&self) -> bool {
        self.above > 1.645
    }
}

/// The results of all rigs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    pub rows: Vec<Row>,
    /// Each fold in which the loop was closed.
    pub folds: Vec<Compared>,
    /// Methods that were not run, each with the reason.
    pub not_run: BTreeMap<Method, String>,
    /// Fold, method and error of each failure.
    pub failures: Vec<(String, Method, String)>,
    pub seconds: f64,
}

/// Pool the results of the folds.
pub fn summarise(rigs: &[Measured], lines: &[Line], not_run: BTreeMap<Method, String>) -> Summary {
    let row = |rig| {
        let lines = Lines { rig, lines };
        lines
            .groups()
            .into_iter()
            .map(move |group| lines.row(group))
    };
    let failure = |line: &Line| {
        let error = line.found.as_ref().err()?;
        Some((
            format!("{}, {}", line.rig, line.fold),
            line.method,
            error.clone(),
        ))
    };
    Summary {
        rows: rigs.iter().flat_map(row).collect(),
        folds: rigs
            .iter()
            .flat_map(|rig| Lines { rig, lines }.compared())
            .collect(),
        not_run,
        failures: lines.iter().filter_map(failure).collect(),
        seconds: lines.iter().map(|line| line.seconds).sum(),
    }
}

impl Row {
    /// The rig, and the group of its test logs.
    pub fn name(&self) -> String {
        match &self.group {
            Some(group) => format!("{}, {group}", self.rig),
            None => self.rig.clone(),
        }
    }
}

/// The results of one rig.
#[derive(Clone, Copy)]
struct Lines<'a> {
    rig: &'a Measured,
    lines: &'a [Line],
}

impl<'a> Lines<'a> {
    /// The rows of the rig.
    fn groups(self) -> Vec<Option<&'a str>> {
        let also = self.rig.rig.also.keys();
        std::iter::once(None)
            .chain(also.map(|group| Some(group.as_str())))
            .collect()
    }

    fn row(self, group: Option<&str>) -> Row {
        let folds = self.folds(group);
        let models = self.models(&folds, group);
        let error = |what: &Scored| models.iter().find(|(w, _)| w == what)?.1.error();
        let ratio = |what: Option<f64>, of: Option<f64>| Some(what? / of?);
        let (after, best) = (error(&Scored::After), best(&models));
        let closed = folds
            .iter()
            .filter_map(|fold| self.of(fold, Method::CloseLoop));
        let closed: Vec<&Line> = closed.collect();
        let said: Vec<&Said> = closed.iter().filter_map(|line| line.said()).collect();
        let seconds: Vec<f64> = closed.iter().map(|line| line.seconds).collect();
        Row {
            rig: self.rig.rig.name.clone(),
            group: group.map(str::to_owned),
            folds: folds.len(),
            ratio: ratio(after, best.as_ref().map(|(_, error)| *error)),
            hybrid_ratio: ratio(error(&Scored::Hybrid), after),
            best,
            named: counts(said.iter().flat_map(|said| said.names.clone())),
            verdicts: counts(said.iter().map(|said| word(said.verdict))),
            seconds: (!seconds.is_empty()).then(|| median(&seconds)),
            models: models.into_iter().map(|(_, entry)| entry).collect(),
        }
    }

    /// Every model with its error in a row.
    fn models(self, folds: &[&'a Fold], group: Option<&str>) -> Vec<(Scored, Entry)> {
        let of_method = |method: Method| {
            let scored = method.scores(self.rig).into_iter();
            scored.map(move |what| {
                let entry = self.entry(method, &what, folds, group);
                (what, entry)
            })
        };
        Method::ALL.into_iter().flat_map(of_method).collect()
    }

    /// Folds with test logs of a row.
    fn folds(self, group: Option<&str>) -> Vec<&'a Fold> {
        let in_group = |fold: &&Fold| {
            fold.places
                .iter()
                .any(|place| place.group.as_deref() == group)
        };
        self.rig.folds.iter().filter(in_group).collect()
    }

    /// The result of a method in a fold.
    fn of(self, fold: &Fold, method: Method) -> Option<&'a Line> {
        let rig = &self.rig.rig.name;
        let is_it =
            |line: &&Line| line.rig == *rig && line.fold == fold.name && line.method == method;
        self.lines.iter().find(is_it)
    }

    /// The folds in which the loop was closed, each beside simpler models.
    fn compared(self) -> Vec<Compared> {
        let fold = |fold: &Fold| {
            let after = self.squares(fold, Method::CloseLoop, &Scored::After)?;
            let simpler = |(method, what): (Method, Scored)| {
                let squares = self.squares(fold, method, &what)?;
                Some(Simpler {
                    model: what.to_string(),
                    error: squares.rms(),
                    above: after.above(&squares),
                })
            };
            let all = [
                (Method::CloseLoop, Scored::Fitted),
                (Method::CloseLoop, Scored::Usual),
                (Method::Plain, Scored::Plain),
            ];
            Some(Compared {
                rig: self.rig.rig.name.clone(),
                fold: fold.name.clone(),
                after: after.rms(),
                simpler: all.into_iter().filter_map(simpler).collect(),
            })
        };
        self.rig.folds.iter().filter_map(fold).collect()
    }

    /// The errors of a model on all test logs of a fold, at the horizon of the table.
    fn squares(self, fold: &Fold, method: Method, what: &Scored) -> Option<Squares> {
        let errors = self.of(fold, method)?.errors(what)?;
        let middle = errors.iter().map(|log| &log[log.len() / 2]);
        Some(Squares::pooled(middle))
    }

    fn entry(
        self,
        method: Method,
        what: &Scored,
        folds: &[&'a Fold],
        group: Option<&str>,
    ) -> Entry {
        let mut logs: Vec<(String, &LogErrors)> = Vec::new();
        let (mut failed, mut missing) = (0, 0);
        for fold in folds {
            let Some(line) = self.of(fold, method) else {
                missing += 1;
                continue;
            };
            let Some(errors) = line.errors(what) else {
                failed += 1;
                continue;
            };
            let in_group = fold.places.iter().zip(errors);
            let in_group = in_group.filter(|(place, _)| place.group.as_deref() == group);
            logs.extend(in_group.map(|(place, errors)| (place.log.clone(), errors)));
        }
        let all: Vec<&LogErrors> = logs.iter().map(|(_, errors)| *errors).collect();
        Entry {
            model: what.to_string(),
            failed,
            missing,
            pooled: horizons(&all),
            logs: logs
                .iter()
                .map(|(log, errors)| (log.clone(), horizons(&[*errors])))
                .collect(),
        }
    }
}

impl Line {
    fn said(&self) -> Option<&Said> {
        self.found.as_ref().ok()?.said.as_ref()
    }

    fn errors(&self, what: &Scored) -> Option<&[LogErrors]> {
        let errors = &self.found.as_ref().ok()?.errors;
        errors
            .iter()
            .find(|(scored, _)| scored == what)
            .map(|(_, errors)| errors.as_slice())
    }
}

impl Entry {
    /// The error in the table \[rad\], if every fold has one.
    pub fn error(&self) -> Option<f64> {
        let middle = self.middle()?;
        (self.failed + self.missing == 0 && middle.windows > 0).then_some(middle.position_rms)
    }

    /// The horizon of the table.
    pub fn middle(&self) -> Option<&Horizon> {
        self.pooled.get(self.pooled.len() / 2)
    }
}

/// The best of the models that closing the loop has to match, and its error.
fn best(models: &[(Scored, Entry)]) -> Option<(String, f64)> {
    let rivals = models.iter().filter(|(what, _)| what.is_rival());
    rivals
        .filter_map(|(what, entry)| Some((what.to_string(), entry.error()?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

fn horizons(logs: &[&LogErrors]) -> Vec<Horizon> {
    let horizons_s = Settings::default().score.horizons_s;
    let horizon = |(k, horizon_s)| {
        let squares = Squares::pooled(logs.iter().map(|errors| &errors[k]));
        Horizon {
            horizon_s,
            position_rms: squares.rms(),
            position_median: squares.median(),
            windows: squares.windows.len(),
            diverged: squares.diverged,
        }
    };
    horizons_s.into_iter().enumerate().map(horizon).collect()
}

fn counts(all: impl Iterator<Item = String>) -> BTreeMap<String, usize> {
    all.fold(BTreeMap::new(), |mut counts, one| {
        *counts.entry(one).or_default() += 1;
        counts
    })
}

/// `partly explained`
fn word(verdict: Verdict) -> String {
    let json = serde_json::to_value(verdict).expect("a verdict is a word");
    json.as_str().unwrap_or_default().replace('_', " ")
}
