//! `report.html`: the document for a browser, made from `report.json` alone; also the results of experiments and of the
//! bench. A single file that needs no network.

mod blocks;
mod maths;
mod motion;
mod results;
mod show;

use maud::{DOCTYPE, Markup, PreEscaped, html};

pub use results::ResultsPage;

use super::document::{Document, document};
use super::schema::Report;
use blocks::shown;

pub(super) use show::{pictures, pictures_of};

/// The page of a report.
pub fn page(report: &Report) -> String {
    let end = html! {
        (data(report))
        script { (PreEscaped(include_str!("uplot/uPlot.iife.min.js"))) }
        script { (PreEscaped(include_str!("script.js"))) }
    };
    framed(&document(report), &end)
}

/// The page of a document, and what the browser reads at its end.
fn framed(document: &Document, end: &Markup) -> String {
    let Document {
        about,
        headline,
        head,
        sections,
    } = document;
    let whole = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (about) ": " (headline) }
                style { (PreEscaped(include_str!("uplot/uPlot.min.css"))) (PreEscaped(include_str!("style.css"))) }
            }
            body {
                header {
                    p.system { (about) }
                    h1 { (headline) }
                    (shown(head))
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
                            (shown(&section.answer))
                        }
                    }
                }
                (end)
            }
        }
    };
    whole.into_string()
}

/// The report itself, for the pictures and for other programs. No text in it can end the element.
fn data(report: &Report) -> Markup {
    let json = serde_json::to_string(report).expect("a report has only finite numbers and texts");
    html! {
        script id="report" type="application/json" { (PreEscaped(json.replace('<', "\\u003c"))) }
    }
}
