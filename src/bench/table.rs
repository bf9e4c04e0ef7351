//! The results of many cells, summarised in a table.

use std::collections::BTreeMap;
use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::cell::{Findings, KnownStructure, Searched};
use super::grid::{Cell, Group};
use super::judge::{Coverage, Judgement};
use crate::closeloop::Verdict;
use crate::data::statistics::{rank_quantile, wilson};

/// One cell and its result; one line of `cells.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Identifies the configuration of the cell.
    pub configuration: String,
    /// Identifies the build of the program.
    pub program: String,
    pub seconds: f64,
    pub cell: Cell,
    /// The findings, or why closing the loop failed.
    pub findings: Result<Findings, String>,
}

/// A relative frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    pub hits: usize,
    pub of: usize,
}

impl Rate {
    fn count(all: impl Iterator<Item = bool>) -> Self {
        all.fold(Self { hits: 0, of: 0 }, |rate, hit| Self {
            hits: rate.hits + usize::from(hit),
            of: rate.of + 1,
        })
    }

    /// The share; NaN without a trial.
    #[allow(clippy::cast_precision_loss)] // counts are small
    pub fn share(self) -> f64 {
        self.hits as f64 / self.of as f64
    }

    /// 95 % interval of the share (Wilson 1927).
    pub fn wilson(self) -> [f64; 2] {
        wilson(self.hits, self.of)
    }
}

/// One row of the table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    pub what: String,
    pub rate: Rate,
    pub wilson: [f64; 2],
}

impl Row {
    fn new(what: impl Into<String>, rate: Rate) -> Self {
        Self {
            what: what.into(),
            rate,
            wilson: rate.wilson(),
        }
    }
}

/// The results of a grid.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    pub cells: usize,
    /// Cells on which closing the loop failed, each with its error.
    pub errors: Vec<(String, String)>,
    pub rows: Vec<Row>,
    /// Error after over error of the true structure, 0.5 s ahead: median, 90 % quantile and largest over the
    /// cells with an effect of the library.
    pub held_out_ratio: Option<[f64; 3]>,
    /// Number of cells whose true structure the library cannot express.
    pub not_told: usize,
    /// Passed, by the name of each effect that was hidden.
    pub by_effect: Vec<Row>,
    /// Passed, by plant and condition.
    pub by_condition: Vec<Row>,
    /// Intervals that hold the truth, by parameter.
    pub by_parameter: Vec<Row>,
    pub failures: Vec<Failure>,
    pub seconds: Seconds,
}

/// A cell that was not passed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Failure {
    pub cell: String,
    pub group: Group,
    pub named: Vec<String>,
    pub within: bool,
    pub verdict: Verdict,
    pub ratio: Option<f64>,
}

/// Run time of a cell \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Seconds {
    pub median: f64,
    pub longest: f64,
    pub total: f64,
}

/// The error after is as small as that of the true structure when it exceeds it by no more than this.
const AS_GOOD: f64 = 1.1;

/// A cell on which closing the loop failed counts as not passed wherever it counts.
struct Done<'l> {
    cell: &'l Cell,
    findings: Option<&'l Searched>,
    told: Option<&'l KnownStructure>,
}

impl<'l> Done<'l> {
    fn of(line: &'l Line) -> Self {
        let (findings, told) = match &line.findings {
            Ok(Findings::Searched(searched)) => (Some(&**searched), None),
            Ok(Findings::Told(told)) => (None, Some(told)),
            Err(_) => (None, None),
        };
        Self {
            cell: &line.cell,
            findings,
            told,
        }
    }

    fn shows(&self, what: impl Fn(&Judgement) -> bool) -> bool {
        self.findings.is_some_and(|f| what(&f.judgement))
    }

    fn ratio(&self) -> Option<f64> {
        self.findings?.errors.ratio()
    }

    /// Of the effects that were named, or of those that the fit was told.
    fn coverage(&self) -> &[Coverage] {
        let named = self.findings.map(|f| &f.judgement.coverage);
        let told = self.told.map(|told| &told.coverage);
        named.or(told).map_or(&[], Vec::as_slice)
    }

    fn is_told(&self) -> bool {
        self.cell.group == Group::Told
    }
}

/// Count.
pub fn summarise(lines: &[Line]) -> Summary {
    let done: Vec<Done<'_>> = lines.iter().map(Done::of).collect();
    let failed = lines.iter().filter_map(|line| {
        let error = line.findings.as_ref().err()?;
        Some((line.cell.id.clone(), error.clone()))
    });
    let known: Vec<&Done<'_>> = done
        .iter()
        .filter(|d| matches!(d.cell.group, Group::Single | Group::Pair | Group::Several))
        .collect();
    let ratios: Vec<f64> = known.iter().filter_map(|d| d.ratio()).collect();
    Summary {
        cells: lines.len(),
        errors: failed.collect(),
        rows: rows(&done, &ratios),
        not_told: known.len() - ratios.len(),
        held_out_ratio: (!ratios.is_empty())
            .then(|| [0.5, 0.9, 1.0].map(|q| rank_quantile(&ratios, q))),
        by_effect: by(&done, |d| {
            d.cell.effects.iter().map(|e| e.name.clone()).collect()
        }),
        by_condition: by(&done, |d| {
            vec![format!("{}, {}", d.cell.plant, d.cell.condition)]
        }),
        by_parameter: by_parameter(&done),
        failures: done.iter().filter_map(failure).collect(),
        seconds: seconds(lines),
    }
}

fn rows(done: &[Done<'_>], ratios: &[f64]) -> Vec<Row> {
    let of = |group: Group, hit: &dyn Fn(&Done<'_>) -> bool| {
        Rate::count(done.iter().filter(|d| d.cell.group == group).map(hit))
    };
    let exact = |d: &Done<'_>| d.shows(|j| j.exact);
    let within = |d: &Done<'_>| d.shows(|j| j.within);
    let named = |d: &Done<'_>| !d.findings.is_some_and(|f| f.answer.named.is_empty());
    let flagged_in_vain = |d: &Done<'_>| !d.shows(|j| !j.flagged);
    let flagged = |d: &Done<'_>| d.shows(|j| j.flagged);
    let passed = |d: &Done<'_>| d.shows(|j| j.passed);
    let mut rows = vec![
        Row::new("one effect: exact", of(Group::Single, &exact)),
        Row::new(
            "one effect: exact or a listed alternative",
            of(Group::Single, &within),
        ),
        Row::new("two effects: exact", of(Group::Pair, &exact)),
        Row::new(
            "two effects: exact or listed alternatives",
            of(Group::Pair, &within),
        ),
    ];
    rows.extend(rows_of_several(done));
    rows.extend([
        Row::new("no effect: something is named", of(Group::None, &named)),
        Row::new(
            "no effect: something is flagged",
            of(Group::None, &flagged_in_vain),
        ),
        Row::new(
            "no effect: nothing is named, nothing flagged",
            of(Group::None, &passed),
        ),
        Row::new("outside the library: flagged", of(Group::Outside, &flagged)),
        Row::new(
            "outside the library: flagged, and no false name that cuts less than half of the error",
            of(Group::Outside, &passed),
        ),
    ]);
    rows.extend(rows_of_intervals(done));
    rows.push(Row::new(
        "error after within a tenth of that of the true structure",
        Rate::count(ratios.iter().map(|ratio| *ratio <= AS_GOOD)),
    ));
    rows
}

/// Rigs that hide several effects: how many were named completely, and how many of the effects.
fn rows_of_several(done: &[Done<'_>]) -> Vec<Row> {
    let several: Vec<&Done<'_>> = done
        .iter()
        .filter(|d| d.cell.group == Group::Several)
        .collect();
    let exact = |joints: usize| {
        let on = several.iter().filter(|d| d.cell.joints() == Some(joints));
        Rate::count(on.map(|d| d.shows(|j| j.exact)))
    };
    let within = several.iter().map(|d| d.shows(|j| j.within));
    // A cell that could not be run has named nothing.
    let hidden = several.iter().flat_map(|d| {
        let found = |label: &String| d.shows(|j| !j.missed.contains(label));
        d.cell
            .effects
            .iter()
            .map(move |effect| found(&effect.label()))
    });
    let named = several.iter().filter_map(|d| d.findings).flat_map(|f| {
        let wrong = &f.judgement.wrong;
        f.answer
            .named
            .iter()
            .map(|named| !wrong.contains(&named.label))
    });
    vec![
        Row::new("several effects, one joint: exact", exact(1)),
        Row::new("several effects, two joints: exact", exact(2)),
        Row::new(
            "several effects: exact or listed alternatives",
            Rate::count(within),
        ),
        Row::new(
            "several effects: hidden ones that are named",
            Rate::count(hidden),
        ),
        Row::new(
            "several effects: named ones that are hidden",
            Rate::count(named),
        ),
    ]
}

/// Intervals that hold the truth: of what was named and, apart from it, of structures that were told.
fn rows_of_intervals(done: &[Done<'_>]) -> Vec<Row> {
    let covered = |told: bool, of_effects: bool| {
        let cells = done.iter().filter(|d| d.is_told() == told);
        let all = cells.flat_map(Done::coverage);
        let wanted = all.filter(|c| c.name.contains('.') == of_effects);
        Rate::count(wanted.map(|c| c.covered))
    };
    let fitted = done
        .iter()
        .filter(|d| d.is_told())
        .map(|d| d.told.is_some());
    vec![
        Row::new(
            "95 % intervals of effects that hold the truth",
            covered(false, true),
        ),
        Row::new(
            "95 % intervals of declared parameters that hold the truth",
            covered(false, false),
        ),
        Row::new("told the structure: fitted", Rate::count(fitted)),
        Row::new(
            "told the structure: 95 % intervals of effects that hold the truth",
            covered(true, true),
        ),
        Row::new(
            "told the structure: 95 % intervals of declared parameters that hold the truth",
            covered(true, false),
        ),
    ]
}

fn by(done: &[Done<'_>], keys: impl Fn(&Done<'_>) -> Vec<String>) -> Vec<Row> {
    let mut groups: BTreeMap<String, Vec<bool>> = BTreeMap::new();
    for d in done.iter().filter(|d| !d.is_told()) {
        for key in keys(d) {
            groups.entry(key).or_default().push(d.shows(|j| j.passed));
        }
    }
    counted(groups)
}

fn by_parameter(done: &[Done<'_>]) -> Vec<Row> {
    let mut groups: BTreeMap<String, Vec<bool>> = BTreeMap::new();
    for coverage in done.iter().flat_map(Done::coverage) {
        // One row for a parameter, whatever its joint and log.
        let name = coverage.name.split('[').next().unwrap_or_default();
        let name = match name.split_once('@') {
            Some((effect, rest)) => {
                format!("{effect}{}", rest.trim_start_matches(char::is_numeric))
            }
            None => name.to_owned(),
        };
        groups.entry(name).or_default().push(coverage.covered);
    }
    counted(groups)
}

fn counted(groups: BTreeMap<String, Vec<bool>>) -> Vec<Row> {
    let row = |(name, hits): (String, Vec<bool>)| Row::new(name, Rate::count(hits.into_iter()));
    groups.into_iter().map(row).collect()
}

/// `None` for a passed cell, and for one that could not be run, which is listed by its error.
fn failure(d: &Done<'_>) -> Option<Failure> {
    let Searched {
        answer,
        judgement,
        errors,
        ..
    } = d.findings?;
    let labels = answer.named.iter().map(|named| named.label.clone());
    (!judgement.passed).then(|| Failure {
        cell: d.cell.id.clone(),
        group: d.cell.group,
        named: labels.collect(),
        within: judgement.within,
        verdict: answer.verdict,
        ratio: errors.ratio(),
    })
}

fn seconds(lines: &[Line]) -> Seconds {
    let all: Vec<f64> = lines.iter().map(|line| line.seconds).collect();
    Seconds {
        median: rank_quantile(&all, 0.5),
        longest: rank_quantile(&all, 1.0),
        total: all.iter().sum(),
    }
}

/// The summary as Markdown.
pub fn markdown(summary: &Summary) -> String {
    let mut text = format!(
        "{} cells, {:.0} s; a cell takes {:.1} s (median) to {:.1} s.\n\n",
        summary.cells, summary.seconds.total, summary.seconds.median, summary.seconds.longest
    );
    text += "| | cells | share | 95 % interval |\n|---|---|---|---|\n";
    summary.rows.iter().for_each(|row| push_row(&mut text, row));
    if let Some([median, high, largest]) = summary.held_out_ratio {
        let _ = writeln!(
            text,
            "\nError after over that of the true structure, 0.5 s ahead: median {median:.3}, 90 % quantile \
             {high:.3}, largest {largest:.3}; of {} cells the library cannot fit the true structure.",
            summary.not_told
        );
    }
    let tables = [
        ("effect hidden", "passed", &summary.by_effect),
        ("plant, condition", "passed", &summary.by_condition),
        (
            "parameter",
            "intervals that hold the truth",
            &summary.by_parameter,
        ),
    ];
    for (what, of_what, rows) in tables {
        let _ = write!(
            text,
            "\n| {what} | {of_what} | share | 95 % interval |\n|---|---|---|---|\n"
        );
        rows.iter().for_each(|row| push_row(&mut text, row));
    }
    push_failures(&mut text, summary);
    text
}

fn push_row(text: &mut String, row: &Row) {
    let (Rate { hits, of }, [low, high]) = (row.rate, row.wilson);
    if of > 0 {
        let share = 100.0 * row.rate.share();
        let (low, high) = (100.0 * low, 100.0 * high);
        let _ = writeln!(
            text,
            "| {} | {hits} of {of} | {share:.0} % | {low:.0} to {high:.0} % |",
            row.what
        );
    }
}

fn push_failures(text: &mut String, summary: &Summary) {
    if !summary.failures.is_empty() {
        *text += "\n| cell that failed | named | verdict | within alternatives | error ratio |\n|---|---|---|---|---|\n";
    }
    for failure in &summary.failures {
        let named = match failure.named.as_slice() {
            [] => "nothing".to_owned(),
            named => named.join(", "),
        };
        let ratio = failure
            .ratio
            .map_or("-".to_owned(), |ratio| format!("{ratio:.2}"));
        let within = if failure.within { "yes" } else { "no" };
        let _ = writeln!(
            text,
            "| {} | {named} | {:?} | {within} | {ratio} |",
            failure.cell, failure.verdict
        );
    }
    for (cell, error) in &summary.errors {
        let _ = writeln!(text, "\n{cell}: {error}");
    }
}
