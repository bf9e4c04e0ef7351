//! Which number to trust: each parameter by log, and the fit to each log judged by the other logs.

use maud::{Markup, html};

use super::table;
use crate::by_log::{OfLogEntry, half_width};
use crate::schema::{ParameterEntry, Report};
use crate::wording::{amount, small};
use residyn_core::closeloop::ErrorModel;
use residyn_core::digits::{amount_of, digits_of};

pub(super) fn by_log(report: &Report) -> Markup {
    html! {
        @if !report.by_log.is_empty() {
            h3 { "Do the logs agree?" }
            p { "The model with effects, fitted to each training log alone. A value is marked if its distance from that of all logs "
                "together is more than its own 95 % interval explains, and is not determined if that interval is far wider than the value." }
            (values(report))
            (crossed(report))
            (ranges(report))
        }
    }
}

/// By how much a value of one log is off, in half widths of its interval: 0 within it, 1 to 3 beyond.
fn mark(of_log: &ParameterEntry, of_all: f64) -> &'static str {
    let half = of_log.ci95.map_or(f64::INFINITY, half_width);
    match (of_log.value - of_all).abs() / half {
        far if far > 3.0 => "off-3",
        far if far > 2.0 => "off-2",
        far if far > 1.0 => "off-1",
        _ => "off-0",
    }
}

fn names(report: &Report) -> impl Iterator<Item = &str> {
    report.by_log.iter().map(|log| log.log.as_str())
}

fn values(report: &Report) -> Markup {
    let rows = html! {
        @for of_all in &report.ranges {
            tr {
                th scope="row" { code { (of_all.name) } @if of_all.unit != "1" { ", " (of_all.unit) } }
                td { (digits_of(of_all.value, Some(of_all.range)).0) }
                @for log in &report.by_log { (value(log, &of_all.name, of_all.value)) }
            }
        }
    };
    html! {
        (table(["parameter", "all logs"].into_iter().chain(names(report)), &rows))
        @for log in &report.by_log {
            @if let Some(failure) = &log.failure { p { (log.log) ": " (failure) "." } }
        }
    }
}

fn value(log: &OfLogEntry, name: &str, of_all: f64) -> Markup {
    let own = log
        .parameters
        .iter()
        .find(|parameter| parameter.name == name);
    html! {
        @match own {
            Some(own) if is_known(own) => td class=(mark(own, of_all)) title=(amount(own)) { (digits_of(own.value, own.ci95).0) },
            Some(own) => td title=(amount(own)) { "not determined" },
            None => td { "-" },
        }
    }
}

/// Whether the digits that its interval leaves of a value mean anything.
fn is_known(own: &ParameterEntry) -> bool {
    digits_of(own.value, own.ci95)
        .0
        .parse()
        .is_ok_and(|shown: f64| shown != 0.0 || own.value == 0.0)
}

/// The model fitted to the row's log, scored on the column's log.
fn crossed(report: &Report) -> Markup {
    let what = match report.compared {
        ErrorModel::OutputError => "open-loop position error at the middle horizon, rad (or m)",
        ErrorModel::InverseDynamics => "relative torque error",
    };
    let error = |error: &Option<f64>| error.map_or_else(|| "-".to_owned(), small);
    let rows = html! {
        @for (k, log) in report.by_log.iter().enumerate() {
            tr {
                th scope="row" { (log.log) }
                @for (other, of_log) in log.errors.iter().enumerate() { td.own[other == k] { (error(of_log)) } }
            }
        }
    };
    html! {
        @if report.by_log.iter().any(|log| !log.errors.is_empty()) {
            p { "Fitted to the log of the row, scored on the log of the column: " (what) "." }
            (table(["fitted to"].into_iter().chain(names(report)), &rows))
        }
    }
}

fn ranges(report: &Report) -> Markup {
    html! {
        details {
            summary { "From run to run: ranges for domain randomisation" }
            p { "The interval of the fit, widened by the spread between logs beyond their own intervals. " code { "ranges.json" } " holds the same." }
            ul { @for range in &report.ranges { li { code { (range.name) } " = " (amount_of(range.value, Some(range.range), &range.unit)) } } }
        }
    }
}
