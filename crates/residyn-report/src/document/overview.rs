//! What is missing of a rig of many joints: joints by effects in one table, and first where like joints differ.

use super::Block::{self, Boxed, List, Small};
use super::{Cell, cell, folded, joints, missing, paragraph, table, values};
use crate::overview::{Column, Held, JointErrors, Overview, Row, Standing};
use crate::schema::Report;
use crate::wording::small;
use residyn_core::digits::digits_of;

pub(super) fn answer(report: &Report) -> Vec<Block> {
    let whole = Overview::of(report);
    let equations = folded("The equations", missing::equations(report));
    let table = Boxed("overview", vec![joints_by_effects(report, &whole)]);
    [
        differences(report),
        vec![table, Small(key(&whole)), equations],
    ]
    .concat()
}

/// More differences than this are folded away: the table marks all of them.
const MOST: usize = 3;

fn differences(report: &Report) -> Vec<Block> {
    let mut texts = report.differences.iter().map(|one| one.text(report));
    let first: Vec<String> = texts.by_ref().take(MOST).collect();
    let more: Vec<String> = texts.collect();
    let about = format!("{} more differences", more.len());
    let more = (!more.is_empty()).then(|| folded(about, vec![List(more)]));
    let said = format!("**Built alike, and different:** {}.", first.join("; "));
    let said = (!first.is_empty()).then(|| paragraph(said));
    said.into_iter().chain(more).collect()
}

fn joints_by_effects(report: &Report, whole: &Overview<'_>) -> Block {
    let errors = JointErrors::of(report);
    let JointErrors { about, unit, .. } = &errors;
    let heads = [
        "joint".to_owned(),
        format!("{about}, fitted, {unit}"),
        "with effects".to_owned(),
    ];
    let heads = heads.into_iter().chain(whole.columns.iter().map(head));
    let row = |row: &Row<'_>| {
        let name = Cell {
            class: row.begins_group.then_some("group"),
            part: Some(joints::id(row.joint)),
            ..cell(format!("{} {}", row.joint, report.short_name(row.joint)))
        };
        let errors = errors.pair(row.joint).map(|error| cell(small(error)));
        let held = row
            .cells
            .iter()
            .map(|held| held.as_ref().map_or_else(Cell::default, value));
        [name].into_iter().chain(errors).chain(held).collect()
    };
    table(1, heads, whole.rows.iter().map(row))
}

fn head(column: &Column<'_>) -> String {
    let more = if column.has_more { " \u{2026}" } else { "" };
    let symbol = match column.of == column.symbol {
        true => String::new(),
        false => format!(" `{}`", column.symbol),
    };
    let unit = match column.unit {
        "" | "1" => String::new(),
        unit => format!(", {unit}"),
    };
    format!("{}{symbol}{more}{unit}", column.of)
}

fn value(held: &Held<'_>) -> Cell {
    let shown = held.shown();
    let digits = digits_of(shown.value, shown.ci95).0;
    let mark = held
        .side
        .map_or_else(String::new, |side| format!(" {}", side.mark()));
    let text = match held.standing {
        Standing::Established => format!("**{digits}**{mark}"),
        Standing::Supported | Standing::Declared => format!("{digits}{mark}"),
    };
    Cell {
        class: Some(class(held)),
        hint: Some(values(held.parameters.iter().copied()).replace('`', "")),
        ..cell(text)
    }
}

const fn class(held: &Held<'_>) -> &'static str {
    match (held.standing, held.side) {
        (Standing::Established, None) => "established",
        (Standing::Established, Some(_)) => "established differs",
        (Standing::Supported, None) => "supported",
        (Standing::Supported, Some(_)) => "supported differs",
        (Standing::Declared, None) => "declared",
        (Standing::Declared, Some(_)) => "declared differs",
    }
}

/// What the looks of the values mean, as far as they occur.
fn key(whole: &Overview<'_>) -> String {
    let cells = || whole.rows.iter().flat_map(|row| row.cells.iter().flatten());
    let has = |standing| cells().any(|held| held.standing == standing);
    let said = [
        (has(Standing::Established), "**Bold**: established."),
        (
            has(Standing::Supported),
            "Pale: supported, in the model, but do not rely on the name.",
        ),
        (
            has(Standing::Declared),
            "Plain: declared in the model file, refitted.",
        ),
        (
            cells().any(|held| held.side.is_some()),
            "\u{25b2} \u{25bc}: above or below the joints built alike.",
        ),
        (
            whole.columns.iter().any(|column| column.has_more),
            "\u{2026}: the first of several values.",
        ),
    ];
    let said: Vec<&str> = said
        .into_iter()
        .filter(|(is_so, _)| *is_so)
        .map(|(_, text)| text)
        .collect();
    format!(
        "{} Intervals and all other values are joint by joint below.",
        said.join(" ")
    )
    .trim_start()
    .to_owned()
}
