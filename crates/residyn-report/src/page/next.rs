//! What to do next.

use maud::html;

use super::Section;
use crate::schema::Report;

pub(super) fn section(report: &Report) -> Section {
    let has_serious = report.serious().next().is_some();
    Section {
        id: "next",
        question: "What next?",
        answer: html! {
            ol {
                @if has_serious { li { "Fix the logs: their serious faults stand at the top of this page." } }
                @for rival in &report.alternatives {
                    li { "To distinguish the finding from " strong { (rival.title) } " on joint " (rival.place) ": " (rival.experiment) "." }
                }
                li { "Use the model: " code { (report.files.model) } " holds the declared equations with fitted values and the effects. "
                    code { "residyn export" } " writes it as C, ONNX, FMU, MJCF and more." }
                li { "Predict a log that is not among these: " code { "residyn evaluate" } " takes " code { (report.files.model) } "." }
            }
        },
    }
}
