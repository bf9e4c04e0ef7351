//! `report.html`: the report for a browser, made from `report.json` alone. One file that needs no network, in the order of a
//! reader's questions.

mod better;
mod calibration;
mod logs;
mod made;
mod maths;
mod missing;
mod motion;
mod next;
mod show;
mod trust;

use maud::{DOCTYPE, Markup, PreEscaped, html};

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
    let whole = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (report.system) ": " (report.headline) }
                style { (PreEscaped(include_str!("uplot/uPlot.min.css"))) (PreEscaped(include_str!("style.css"))) }
            }
            body {
                (header(report, &sections))
                main {
                    @for section in &sections {
                        section id=(section.id) {
                            h2 { (section.question) }
                            (section.answer)
                        }
                    }
                }
                (data(report))
                script { (PreEscaped(include_str!("uplot/uPlot.iife.min.js"))) }
                script { (PreEscaped(include_str!("script.js"))) }
            }
        }
    };
    whole.into_string()
}

fn header(report: &Report, sections: &[Section]) -> Markup {
    html! {
        header {
            p.system { (report.system) }
            h1 { (report.headline) }
            p { (capitalised(&report.reason)) "." }
            @for (log, finding) in report.serious() {
                p.serious { strong { (log) } ": " (finding.to_string()) }
            }
            nav aria-label="Sections" {
                @for section in sections {
                    a href={ "#" (section.id) } { (section.question) }
                }
            }
        }
    }
}

/// The report itself, for the pictures and for other programs. No text in it can end the element.
fn data(report: &Report) -> Markup {
    let json = serde_json::to_string(report).expect("a report has only finite numbers and texts");
    html! {
        script id="report" type="application/json" { (PreEscaped(json.replace('<', "\\u003c"))) }
    }
}
