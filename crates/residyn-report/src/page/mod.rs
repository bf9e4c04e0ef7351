//! `report.html`: the report for a browser, made from `report.json` alone; also the results of experiments and of the
//! bench. A single file that needs no network, in the order of a reader's questions.

mod better;
mod calibration;
mod logs;
mod made;
mod maths;
mod missing;
mod motion;
mod next;
mod results;
mod show;
mod trust;

use maud::{DOCTYPE, Markup, PreEscaped, html};

pub use results::ResultsPage;

use super::schema::Report;
use super::wording::capitalised;

/// One section: its name in the list of contents, its question, and the answer.
struct Section {
    id: &'static str,
    question: &'static str,
    answer: Markup,
}

/// The page of a report.
pub fn page(report: &Report) -> String {
    let sections = [
        missing::section(report),
        better::section(report),
        trust::section(report),
        show::section(report),
        next::section(report),
        made::section(report),
    ];
    let title = format!("{}: {}", report.system, report.headline);
    let end = html! {
        (data(report))
        script { (PreEscaped(include_str!("uplot/uPlot.iife.min.js"))) }
        script { (PreEscaped(include_str!("script.js"))) }
    };
    framed(&title, &head(report), &sections, &end)
}

/// A page: what stands at its head, its sections, and what the browser reads at its end.
fn framed(title: &str, head: &Markup, sections: &[Section], end: &Markup) -> String {
    let whole = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(include_str!("uplot/uPlot.min.css"))) (PreEscaped(include_str!("style.css"))) }
            }
            body {
                header {
                    (head)
                    nav aria-label="Sections" {
                        @for section in sections {
                            a href={ "#" (section.id) } { (section.question) }
                        }
                    }
                }
                main {
                    @for section in sections {
                        section id=(section.id) {
                            h2 { (section.question) }
                            (section.answer)
                        }
                    }
                }
                (end)
            }
        }
    };
    whole.into_string()
}

fn head(report: &Report) -> Markup {
    html! {
        p.system { (report.system) }
        h1 { (report.headline) }
        p { (capitalised(&report.reason)) "." }
        @for (log, finding) in report.serious() {
            p.serious { strong { (log) } ": " (finding.to_string()) }
        }
    }
}

/// A table that scrolls by itself if it is wide.
fn table<'h>(heads: impl IntoIterator<Item = &'h str>, rows: &Markup) -> Markup {
    html! {
        div.table tabindex="0" { table {
            thead { tr { @for head in heads { th { (head) } } } }
            tbody { (rows) }
        } }
    }
}

/// The report itself, for the pictures and for other programs. No text in it can end the element.
fn data(report: &Report) -> Markup {
    let json = serde_json::to_string(report).expect("a report has only finite numbers and texts");
    html! {
        script id="report" type="application/json" { (PreEscaped(json.replace('<', "\\u003c"))) }
    }
}
