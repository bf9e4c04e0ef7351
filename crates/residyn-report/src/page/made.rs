//! How the report was made.

use maud::{Markup, html};
use serde::Serialize;

use super::results::ResultsPage;
use super::{Section, table};
use crate::schema::{LogEntry, Report};
use crate::wording::split;
use residyn_core::model::Call;

pub(super) fn section(report: &Report) -> Section {
    let heads = ["log", "role", "rows", "from, s", "to, s", "left out, s"];
    let rows = html! {
        @for log in &report.logs.train { (row(log, "fitted")) }
        @for log in &report.logs.test { (row(log, "test")) }
    };
    of(html! {
        (program(&report.version, Some(report.seed)))
        @if let Some(call) = &report.call { (called(call)) }
        p { "Test logs: " (split(&report.logs.split)) "." }
        (table(heads, &rows))
        (folded("Configuration as resolved", &report.configuration))
        (folded("Every tuning constant", &report.settings))
    })
}

/// As above, for an experiment or the bench.
pub(super) fn of_results(results: &ResultsPage<'_>) -> Section {
    of(html! {
        (program(env!("CARGO_PKG_VERSION"), results.seed))
        (called(results.call))
        (folded("Configuration as resolved", results.configuration))
    })
}

fn of(answer: Markup) -> Section {
    Section {
        id: "made",
        question: "How was it made?",
        answer,
    }
}

fn program(version: &str, seed: Option<u64>) -> Markup {
    html! {
        p {
            "residyn " (version)
            @if let Some(seed) = seed { ", seed " (seed) }
            ". The same seed gives the same result on the same machine."
        }
    }
}

fn folded(what: &str, value: &impl Serialize) -> Markup {
    let text =
        serde_json::to_string_pretty(value).expect("a report has only finite numbers and texts");
    html! { details { summary { (what) } pre tabindex="0" { (text) } } }
}

/// The command, when it ran, and its files with their hashes.
fn called(call: &Call) -> Markup {
    let files = html! {
        @for file in &call.inputs {
            tr { td { (file.role) } th scope="row" { (file.path) } td { code { (file.sha256) } } }
        }
    };
    html! {
        p { "Started on " (call.began) ", took " (format!("{:.1}", call.took_s)) " s:" }
        pre tabindex="0" { (call.command) }
        @if !call.inputs.is_empty() {
            (table(["read as", "file", "SHA-256"], &files))
        }
    }
}

fn row(log: &LogEntry, role: &str) -> Markup {
    let left_out: Vec<String> = (log.leave_out.iter())
        .map(|[start, end]| format!("{start} to {end}"))
        .collect();
    html! {
        tr {
            th scope="row" { (log.name) } td { (role) } td { (log.rows) } td { (format!("{:.2}", log.start_s)) } td { (format!("{:.2}", log.end_s)) }
            td { (left_out.join(", ")) }
        }
    }
}
