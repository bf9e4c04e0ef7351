//! Which number to trust: each parameter by log, and the fit to each log judged by the other logs.

use super::{Block, Cell, cell, folded, heading, paragraph, table};
use crate::by_log::{OfLogEntry, RangeEntry};
use crate::schema::{ParameterEntry, Report};
use crate::wording::{amount, small};
use residyn_core::closeloop::ErrorModel;
use residyn_core::digits::{amount_of, digits_of};

pub(super) fn by_log(report: &Report) -> Vec<Block> {
    if report.by_log.is_empty() {
        return Vec::new();
    }
    let about = "The model with effects, fitted to each training log alone. A value is marked with dots if its distance from \
                 that of all logs together is more than its own 95 % interval explains, and is not determined if that interval is \
                 far wider than the value.";
    let failed = report.by_log.iter().filter_map(|log| {
        let failure = log.failure.as_ref()?;
        Some(paragraph(format!("{}: {failure}.", log.log)))
    });
    let title = [heading("Do the logs agree?"), paragraph(about)];
    (title.into_iter().chain([values(report)]).chain(failed))
        .chain(crossed(report))
        .chain([ranges(report)])
        .collect()
}

/// The looks of a value by how far it is off, in half widths of its interval, and the dots that say so.
const MARKS: [(f64, &str, &str); 4] = [
    (3.0, "off-3", " ···"),
    (2.0, "off-2", " ··"),
    (1.0, "off-1", " ·"),
    (0.0, "off-0", ""),
];

fn values(report: &Report) -> Block {
    let logs = report.by_log.iter().map(|log| log.log.as_str());
    let heads = ["parameter", "all logs"].into_iter().chain(logs);
    let row = |of_all: &RangeEntry| {
        let unit = match of_all.unit.as_str() {
            "1" => String::new(),
            unit => format!(", {unit}"),
        };
        let all = [
            cell(format!("`{}`{unit}", of_all.name)),
            cell(digits_of(of_all.value, Some(of_all.range)).0),
        ];
        let own = report.by_log.iter().map(|log| value(log, of_all));
        all.into_iter().chain(own).collect()
    };
    table(1, heads, report.ranges.iter().map(row))
}

fn value(log: &OfLogEntry, of_all: &RangeEntry) -> Cell {
    let mut own = log.parameters.iter();
    let Some(own) = own.find(|parameter| parameter.name == of_all.name) else {
        return cell("-");
    };
    let known = match known(own) {
        Some(digits) => {
            let [low, high] = own.ci95.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            let off = (own.value - of_all.value).abs() / (0.5 * (high - low));
            let mark = MARKS.iter().find(|(least, ..)| off > *least);
            let (_, class, dots) = mark.unwrap_or(&MARKS[3]);
            Cell {
                class: Some(*class),
                ..cell(digits + dots)
            }
        }
        None => cell("not determined"),
    };
    Cell {
        hint: Some(amount(own)),
        ..known
    }
}

/// A value in the digits that its interval leaves, if these mean anything.
fn known(own: &ParameterEntry) -> Option<String> {
    let (digits, _) = digits_of(own.value, own.ci95);
    let shown: f64 = digits.parse().ok()?;
    (shown != 0.0 || own.value == 0.0).then_some(digits)
}

/// The model fitted to the row's log, scored on the column's log.
fn crossed(report: &Report) -> Vec<Block> {
    let what = match report.compared {
        ErrorModel::OutputError => "open-loop position error at the middle horizon, rad (or m)",
        ErrorModel::InverseDynamics => "relative torque error",
    };
    let logs = &report.by_log;
    let heads = ["fitted to"].into_iter();
    let heads = heads.chain(logs.iter().map(|log| log.log.as_str()));
    let row = |(k, log): (usize, &OfLogEntry)| {
        let error = |(other, error): (usize, &Option<f64>)| Cell {
            class: (other == k).then_some("own"),
            ..cell(error.map_or_else(|| "-".to_owned(), small))
        };
        let errors = log.errors.iter().enumerate().map(error);
        [cell(&log.log)].into_iter().chain(errors).collect()
    };
    if logs.iter().all(|log| log.errors.is_empty()) {
        return Vec::new();
    }
    let about = format!("Fitted to the log of the row, scored on the log of the column: {what}.");
    let rows = logs.iter().enumerate().map(row);
    vec![paragraph(about), table(1, heads, rows)]
}

fn ranges(report: &Report) -> Block {
    let about = "The interval of the fit, widened by the spread between logs beyond their own intervals. `ranges.json` holds the \
                 same.";
    let range = |one: &RangeEntry| {
        let amount = amount_of(one.value, Some(one.range), &one.unit);
        format!("`{}` = {amount}", one.name)
    };
    let ranges = Block::List(report.ranges.iter().map(range).collect());
    folded(
        "From run to run: ranges for domain randomisation",
        vec![paragraph(about), ranges],
    )
}
