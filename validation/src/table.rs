//! The results of many cells, summarised in a table.

use std::collections::BTreeMap;
use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::cell::{Findings, Searched};
use super::grid::{Cell, Group, Source};
use super::hidden::Label;
use super::rows::{Done, Rate, Row, rows};
use residyn_core::closeloop::Verdict;
use residyn_core::data::statistics::rank_quantile;
use residyn_plot::Share;

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

/// The results of a grid.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    pub cells: usize,
    /// Cells on which closing the loop failed, each with its error.
    pub errors: Vec<(String, String)>,
    pub rows: Vec<Row>,
    /// Error after closing the loop, divided by the true structure's, 0.5 s ahead: median, 90 % quantile and largest
    /// over the cells with library effects.
    pub held_out_ratio: Option<[f64; 3]>,
    /// Number of cells whose true structure the library cannot express.
    pub not_told: usize,
    /// Cells passed, by the name of each hidden effect.
    pub by_effect: Vec<Row>,
    /// Effects on one of many joints that are named there, by name.
    pub named_by_effect: Vec<Row>,
    /// How many effects of robots are named where they are not hidden, by name.
    pub false_names: BTreeMap<String, usize>,
    /// By plant and condition.
    pub parts: Vec<Part>,
    /// Intervals that hold the truth, by parameter.
    pub by_parameter: Vec<Row>,
    pub failures: Vec<Failure>,
    pub seconds: Seconds,
}

/// The cells of a plant under a condition.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Part {
    pub name: String,
    pub cells: usize,
    pub passed: usize,
    /// Cells whose hidden effects were named, and nothing else.
    pub exact: usize,
    /// Effects that are named and not hidden, and hidden ones that are not named, in all cells together.
    pub false_names: usize,
    pub missed: usize,
    /// Cells that report a missing effect although all hidden effects are named.
    pub false_alarms: usize,
    /// Run time of all cells \[s\].
    pub seconds: f64,
}

impl Part {
    fn add(&mut self, line: &Line) {
        self.cells += 1;
        self.seconds += line.seconds;
        let done = Done::of(line);
        let Some(Searched { judgement, .. }) = done.findings else {
            return;
        };
        self.passed += usize::from(judgement.passed);
        self.exact += usize::from(judgement.exact);
        self.false_names += judgement.wrong.len();
        self.missed += judgement.missed.len();
        self.false_alarms += usize::from(judgement.flagged && judgement.missed.is_empty());
    }
}

/// A cell that did not pass.
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

/// Count the results.
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
        by_effect: by_effect(&done),
        named_by_effect: named_by_effect(&done),
        false_names: false_names(&done),
        parts: parts(lines),
        by_parameter: by_parameter(&done),
        failures: done.iter().filter_map(failure).collect(),
        seconds: seconds(lines),
    }
}

fn parts(lines: &[Line]) -> Vec<Part> {
    let mut all: BTreeMap<String, Part> = BTreeMap::new();
    for line in lines.iter().filter(|line| line.cell.group != Group::Told) {
        let name = format!("{}, {}", line.cell.plant, line.cell.condition);
        let part = all.entry(name.clone()).or_default();
        part.name = name;
        part.add(line);
    }
    all.into_values().collect()
}

fn by_effect(done: &[Done<'_>]) -> Vec<Row> {
    let mut groups: BTreeMap<String, Vec<bool>> = BTreeMap::new();
    let as_one = |d: &&Done<'_>| !d.is_told() && d.cell.group != Group::Joints;
    for d in done.iter().filter(as_one) {
        for effect in &d.cell.effects {
            let hits = groups.entry(effect.name.clone()).or_default();
            hits.push(d.shows(|j| j.passed));
        }
    }
    counted(groups)
}

fn named_by_effect(done: &[Done<'_>]) -> Vec<Row> {
    let mut groups: BTreeMap<String, Vec<bool>> = BTreeMap::new();
    let of_joints = done.iter().filter(|d| d.cell.group == Group::Joints);
    for (label, is_named) in of_joints.flat_map(Done::hidden) {
        groups.entry(effect_of(&label)).or_default().push(is_named);
    }
    counted(groups)
}

fn false_names(done: &[Done<'_>]) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    let of_robots = |d: &&Done<'_>| matches!(d.cell.source, Source::Robot(_));
    let named = done.iter().filter(of_robots).flat_map(Done::named);
    for (label, _) in named.filter(|(_, is_hidden)| !is_hidden) {
        *counts.entry(effect_of(&label)).or_default() += 1;
    }
    counts
}

/// The effect in a label, without its joint.
fn effect_of(label: &Label) -> String {
    label.split('@').next().unwrap_or_default().to_owned()
}

fn by_parameter(done: &[Done<'_>]) -> Vec<Row> {
    let mut groups: BTreeMap<String, Vec<bool>> = BTreeMap::new();
    for coverage in done.iter().flat_map(Done::coverage) {
        // One row per parameter, whatever its joint and log.
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

/// `None` for a cell that passed, and for a cell that could not be run, which is listed by its error.
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

impl Summary {
    /// The first row that counts any cell, in a sentence.
    pub fn headline(&self) -> String {
        let counted = self.rows.iter().find(|row| row.rate.of > 0);
        counted.map_or_else(
            || format!("{} cells", self.cells),
            |Row { what, rate, .. }| format!("{what} in {} of {} cells", rate.hits, rate.of),
        )
    }

    /// How often each row and each hidden effect was right.
    pub fn shares(&self) -> Vec<Share> {
        let share = |what: String, row: &Row| Share {
            what,
            share: row.rate.share(),
            interval: row.wilson,
        };
        let counted = self.rows.iter().filter(|row| row.rate.of > 0);
        let rows = counted.map(|row| share(row.what.clone(), row));
        let effects = self.by_effect.iter();
        let effects = effects.map(|row| share(format!("{} hidden: passed", row.what), row));
        rows.chain(effects).collect()
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
        (
            "effect on one of many joints",
            "named there",
            &summary.named_by_effect,
        ),
        (
            "parameter",
            "intervals that hold the truth",
            &summary.by_parameter,
        ),
    ];
    for (what, of_what, rows) in tables {
        if rows.is_empty() {
            continue;
        }
        let _ = write!(
            text,
            "\n| {what} | {of_what} | share | 95 % interval |\n|---|---|---|---|\n"
        );
        rows.iter().for_each(|row| push_row(&mut text, row));
    }
    if !summary.false_names.is_empty() {
        text += "\n| named where it is not hidden | times |\n|---|---|\n";
        for (name, times) in &summary.false_names {
            let _ = writeln!(text, "| {name} | {times} |");
        }
    }
    push_parts(&mut text, &summary.parts);
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

fn push_parts(text: &mut String, parts: &[Part]) {
    *text += "\n| plant, condition | cells | passed | exact | false names | missed | flagged though nothing is missing | seconds |\n";
    *text += "|---|---|---|---|---|---|---|---|\n";
    for part in parts {
        let Part {
            name,
            cells,
            passed,
            exact,
            false_names,
            missed,
            false_alarms,
            seconds,
        } = part;
        let _ = writeln!(
            text,
            "| {name} | {cells} | {passed} | {exact} | {false_names} | {missed} | {false_alarms} | {seconds:.0} |"
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
