//! Pictures: placeholders that the script fills from the data in the page.

use maud::{Markup, html};

use super::motion::motion;
use crate::overview::is_large;
use crate::plot_data::{ScatterEntry, SegmentEntry, SeriesEntry};
use crate::schema::Report;
use residyn_core::data::Joint;

/// All pictures of a report.
pub(crate) fn pictures(report: &Report) -> Markup {
    let shown = &report.plots;
    html! {
        p.small.screen { "Drag over a curve to zoom in, double-click to see all of it; on the keyboard + and \u{2212} zoom, "
            "arrows move, 0 shows all." }
        @if let Some(shown) = &shown.motion { (motion(shown)) }
        @if is_large(report.joints) {
            p { "The curves of each joint, and the force that each model leaves unexplained, are " a href="#joints" { "joint by joint" } "." }
        } @else {
            (of_all(report))
        }
    }
}

/// The curves and the residual force of one joint.
pub(crate) fn pictures_of(report: &Report, joint: Joint) -> Markup {
    let segments = report.plots.segments.iter().enumerate();
    let curves = segments.filter_map(|(k, segment)| {
        let caption = format!("{} ({})", segment.about, segment.log);
        Some((k, caption, segment.joints.get(joint.index())?))
    });
    let scatter = report.plots.residuals.iter().enumerate();
    let scatter = scatter.filter(|(_, scatter)| scatter.joint == joint);
    html! {
        div.plots { @for (k, caption, tracks) in curves { (curve(k, joint.index(), &caption, tracks)) } }
        @for (k, scatter) in scatter { (clouds(k, scatter)) }
    }
}

fn of_all(report: &Report) -> Markup {
    let shown = &report.plots;
    html! {
        @for (k, segment) in shown.segments.iter().enumerate() { (curves(k, segment)) }
        @if !shown.residuals.is_empty() {
            h3 { "Residual force: what each model leaves unexplained" }
            p.small { "A point is the force that a short segment of motion needs in addition to the model's. The line is what the effects add by "
                "their formulas, with the band of their intervals; if effects depend on more than that, it is the mean of what all of "
                "them explain." }
            @for (k, scatter) in shown.residuals.iter().enumerate() { (scatters(report, k, scatter)) }
        }
    }
}

fn curves(k: usize, segment: &SegmentEntry) -> Markup {
    html! {
        details open[k < 3] {
            summary { (segment.about) " (" (segment.log) ")" }
            div.plots {
                @for (j, tracks) in segment.joints.iter().enumerate() {
                    (curve(k, j, &tracks.quantity, tracks))
                }
            }
        }
    }
}

fn curve(segment: usize, joint: usize, caption: &str, tracks: &SeriesEntry) -> Markup {
    html! {
        figure {
            figcaption { (caption) }
            div.plot tabindex="0" role="img" aria-label=(tracks.quantity) data-segment=(segment) data-joint=(joint) {}
        }
    }
}

fn scatters(report: &Report, k: usize, scatter: &ScatterEntry) -> Markup {
    html! {
        h4 { "Joint " (report.label(scatter.joint)) }
        (clouds(k, scatter))
    }
}

/// The residual force of a joint over its angle, speed, torque and time.
fn clouds(k: usize, scatter: &ScatterEntry) -> Markup {
    let number = scatter.joint;
    let axes = [
        ("q", &scatter.q, format!("q{number}, {}", scatter.units[0])),
        (
            "qd",
            &scatter.qd,
            format!("qd{number}, {}", scatter.units[1]),
        ),
        (
            "tau",
            &scatter.tau,
            format!("tau{number}, {}", scatter.units[2]),
        ),
        ("time", &scatter.time, "time, s".to_owned()),
    ];
    // A plot over a variable that never changes shows nothing.
    let varies = |values: &[f64]| values.iter().any(|value| *value != values[0]);
    html! {
        div.plots.small-plots {
            @for (key, _, axis) in axes.iter().filter(|(_, values, _)| varies(values)) {
                figure {
                    figcaption { "force, " (scatter.units[2]) ", over " (axis) }
                    div.plot tabindex="0" role="img" aria-label={ "residual force over " (axis) } data-scatter=(k) data-over=(key) {}
                }
            }
        }
    }
}
