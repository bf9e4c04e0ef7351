//! What the logs could show, found by simulation.

use maud::{Markup, html};

use crate::calibration::{CalibrationEntry, alarms, hidden, limits, share, simulations, size};

pub(super) fn calibration(found: &CalibrationEntry) -> Markup {
    html! {
        h3 { "What these logs could show" }
        p { (simulations(found)) " " (alarms(found)) "." }
        details {
            summary { "The smallest size of each effect that would be named" }
            p { (limits(found)) }
            div.table tabindex="0" { table {
                thead { tr { th { "effect" } th { "joint" } th { "smallest size" } th { "share of the top torque" } th { "hidden in a simulation" } } }
                tbody {
                    @for one in &found.smallest {
                        tr {
                            th scope="row" { (one.title) }
                            td { (one.joint) } td { (size(one)) } td { (share(one)) } td { (hidden(one)) }
                        }
                    }
                }
            } }
        }
    }
}
