//! The rig in motion, which the script plays.

use maud::{Markup, html};

use crate::motion::MotionEntry;
use crate::motion::sketch::PictureEntry;
use crate::wording::{FITTED, WITH_EFFECTS};

pub(super) fn motion(shown: &MotionEntry) -> Markup {
    html! {
        h3 { "The rig in motion" }
        p.small {
            "The beginning of " (shown.log) ". Each prediction starts from the log, runs for " (shown.horizon_s)
            " s under the logged commands, and restarts. " (shown.drawn) " It is paused at the moment when the declared model is farthest off."
        }
        figure.motion {
            div.plots {
                @for (k, picture) in shown.pictures.iter().enumerate() {
                    figure {
                        @if shown.pictures.len() > 1 { figcaption { (picture.about) } }
                        (drawn(k, picture, shown.still))
                    }
                }
            }
            figcaption.key {
                @for (kind, name) in [("measured", "measured"), ("before", FITTED), ("after", WITH_EFFECTS)] {
                    span { svg viewBox="0 0 30 10" aria-hidden="true" { polyline class=(kind) points="2,5 28,5" {} } (name) }
                }
            }
            div.controls {
                button.screen type="button" { "Play" }
                input.screen type="range" min="0" max=(shown.time.len() - 1) value=(shown.still) aria-label="time in the log";
                output { (clock(shown.time[shown.still])) }
            }
        }
    }
}

/// In the format that the script uses as well.
fn clock(time_s: f64) -> String {
    format!("at {time_s:.2} s")
}

fn drawn(k: usize, picture: &PictureEntry, still: usize) -> Markup {
    let lines = [
        ("measured", &picture.measured),
        ("before", &picture.before),
        ("after", &picture.after),
    ];
    html! {
        svg viewBox=(picture.view_box) role="img" aria-label={ (picture.about) ", measured and predicted" } {
            polyline.ground points=(picture.ground) {}
            @for (kind, frames) in lines {
                polyline class=(kind) data-picture=(k) data-kind=(kind) points=(frames[still]) {}
            }
        }
    }
}
