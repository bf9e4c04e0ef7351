//! What the logs could show, found by simulation.

use maud::{Markup, html};

use super::table;
use crate::calibration::{CalibrationEntry, alarms, hidden, limits, share, simulations, size};

pub(super) fn calibration(found: &CalibrationEntry) -> Markup {
    let heads = [
        "effect",
        "joint",
        "smallest size",
        "share of the top torque",
        "hidden in a simulation",
    ];
    let rows = html! {
        @for one in &found.smallest {
            tr {
                th scope="row" { (one.title) }
                td { (one.joint) } td { (size(one)) } td { (share(one)) } td { (hidden(one)) }
            }
        }
    };
    html! {
        h3 { "What these logs could show" }
        p { (simulations(found)) " " (alarms(found)) "." }
        details {
            summary { "The smallest size of each effect that would be named" }
            p { (limits(found)) }
            (table(heads, &rows))
        }
    }
}
