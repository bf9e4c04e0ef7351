//! Pictures: places that the script fills from the data in the page.

use maud::{Markup, html};

use super::Section;
use super::motion::motion;
use crate::schema::Report;
use crate::shown::{CloudEntry, StretchEntry};

pub(super) fn section(report: &Report) -> Section {
    let shown = &report.shown;
    Section {
        id: "show",
        question: "Show me",
        answer: html! {
            p.small.screen { "Drag over a curve to zoom in, double-click to see all of it; on the keyboard + and \u{2212} zoom, "
                "arrows move, 0 shows all." }
            @if let Some(shown) = &shown.motion { (motion(shown)) }
            @for (k, stretch) in shown.stretches.iter().enumerate() { (curves(k, stretch)) }
            @if !shown.residuals.is_empty() {
                h3 { "Residual force: what each model leaves unexplained" }
                p.small { "A point is the force that a short stretch of motion needs beside that of the model. The line is what the effects add by "
                    "their formulas, with the band of their intervals; where effects depend on more, it is the mean of what all of "
                    "them explain." }
                @for (k, cloud) in shown.residuals.iter().enumerate() { (clouds(report, k, cloud)) }
            }
        },
    }
}

fn curves(k: usize, stretch: &StretchEntry) -> Markup {
    html! {
        details open[k < 3] {
            summary { (stretch.about) " (" (stretch.log) ")" }
            div.plots {
                @for (j, tracks) in stretch.joints.iter().enumerate() {
                    figure {
                        figcaption { (tracks.quantity) }
                        div.plot tabindex="0" role="img" aria-label=(tracks.quantity) data-stretch=(k) data-joint=(j) {}
                    }
                }
            }
        }
    }
}

fn clouds(report: &Report, k: usize, cloud: &CloudEntry) -> Markup {
    let number = cloud.joint;
    let axes = [
        ("q", &cloud.q, format!("q{number}, {}", cloud.units[0])),
        ("qd", &cloud.qd, format!("qd{number}, {}", cloud.units[1])),
        (
            "tau",
            &cloud.tau,
            format!("tau{number}, {}", cloud.units[2]),
        ),
        ("time", &cloud.time, "time, s".to_owned()),
    ];
    // Over what never changes there is nothing to see.
    let varies = |values: &[f64]| values.iter().any(|value| *value != values[0]);
    html! {
        h4 { "Joint " (report.label(number)) }
        div.plots.small-plots {
            @for (key, _, axis) in axes.iter().filter(|(_, values, _)| varies(values)) {
                figure {
                    figcaption { "force, " (cloud.units[2]) ", over " (axis) }
                    div.plot tabindex="0" role="img" aria-label={ "residual force over " (axis) } data-cloud=(k) data-over=(key) {}
                }
            }
        }
    }
}
