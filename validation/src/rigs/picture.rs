//! The errors of the table as a figure.

use super::table::{Entry, Row, Summary};
use residyn_plot::{Bar, ErrorRow, JointKind, PlotError, Role, error_bars};

/// Models without a colour of their own elsewhere, in the order of their colours; published sets follow.
const OTHERS: [&str; 2] = ["plain structure", "mujoco.sysid"];

/// A bar for each model that was fitted or published, rig by rig, as SVG text; none if no error is known. The declared
/// model as written is left out: it may be a guess, next to which no other bar could be read.
///
/// # Errors
/// None for a summary.
pub fn picture(summary: &Summary) -> Result<Option<String>, PlotError> {
    let rows: Vec<ErrorRow> = summary.rows.iter().filter_map(row).collect();
    let title = "Open-loop position error on logs left out of the fit";
    (!rows.is_empty())
        .then(|| error_bars(&rows, title))
        .transpose()
}

fn row(row: &Row) -> Option<ErrorRow> {
    let names = row.models.iter().map(|entry| entry.model.as_str());
    let published = names.filter(|name| name.starts_with("published "));
    let others: Vec<&str> = OTHERS.into_iter().chain(published).collect();
    let bar = |entry: &Entry| {
        Some(Bar {
            role: role(&entry.model, &others)?,
            label: entry.model.clone(),
            error: entry.error()?,
        })
    };
    let bars: Vec<Bar> = row.models.iter().filter_map(bar).collect();
    let horizon_s = row.models.iter().find_map(Entry::middle)?.horizon_s;
    (!bars.is_empty()).then(|| ErrorRow {
        of: row.name(),
        kind: JointKind::Revolute,
        horizon_s,
        bars,
    })
}

/// None for the declared model as written.
fn role(model: &str, others: &[&str]) -> Option<Role> {
    match model {
        "declared, fitted" => Some(Role::Before),
        "after" => Some(Role::After),
        "hybrid" => Some(Role::Hybrid),
        _ => {
            let place = others.iter().position(|other| *other == model);
            place.map(Role::Against)
        }
    }
}
