//! The answer for a rig of many joints, in at most thirty lines of a hundred characters: verdict, errors, the table of joints by
//! effects, where like joints differ, and what is left.

use std::path::Path;

use super::{FIX_LOGS, LINES, Words, files, serious, trust};
use crate::document::{reasons, structure};
use crate::overview::{Column, Held, JointErrors, Overview, Row, Side, Standing, sentence};
use crate::schema::Report;
use residyn_core::closeloop::Stage;
use residyn_core::layout::wrap;

const WIDTH: usize = 100;
/// Most rows of the table.
const ROWS: usize = 12;
/// Between two columns.
const GAP: usize = 2;

pub(super) fn summary(
    report: &Report,
    seconds: &[(Stage, f64)],
    folder: &Path,
    words: &Words<'_>,
) -> String {
    let (middle, _) = report.error.middle();
    let (reason, more) = reasons(report);
    let more = match more.len() {
        0 => String::new(),
        1 => " (and 1 more remark in report.md)".to_owned(),
        count => format!(" (and {count} more remarks in report.md)"),
    };
    let head = serious(report, words).into_iter();
    let head = head.chain([
        format!("{}: {reason}{more}", report.headline),
        format!(
            "How much better is it? {}",
            sentence(report, middle..middle + 1).replace("**", "")
        ),
    ]);
    let first: Vec<String> = head.flat_map(|text| paragraph("", &text)).collect();
    let first = [first, table(report)].concat();
    let last = [
        format!("What is left? {}", structure(report)),
        next(report, folder, words),
    ];
    let last = last.iter().flat_map(|text| paragraph("", text));
    let last: Vec<String> = last.chain([files(seconds, folder)]).collect();
    let room = LINES.saturating_sub(first.len() + last.len());
    [first, remarks(report, room), last].concat().join("\n") + "\n"
}

/// What to do next. Of many joints, each has explanations to rule out: they are counted above.
fn next(report: &Report, folder: &Path, words: &Words<'_>) -> String {
    let message = match report.serious().next() {
        Some(_) => FIX_LOGS.to_owned(),
        None => (words.predict)(&folder.join(&report.files.model)),
    };
    format!("What next? {message}")
}

/// Most differences that are listed before other remarks.
const DIFFERENCES: usize = 3;

/// Where like joints differ and what else matters, as far as there is room.
fn remarks(report: &Report, room: usize) -> Vec<String> {
    let differ = report
        .differences
        .iter()
        .map(|one| format!("differs: {}", one.text(report)));
    let first = differ.clone().take(DIFFERENCES);
    let rest = differ.skip(DIFFERENCES);
    let all = first.chain(trust::remarks_in_short(report)).chain(rest);
    let mut lines: Vec<String> = Vec::new();
    for text in all {
        let own = paragraph("  ", &text);
        if lines.len() + own.len() <= room {
            lines.extend(own);
        }
    }
    lines
}

fn paragraph(indent: &str, text: &str) -> Vec<String> {
    let lines = wrap(text, WIDTH - indent.len()).into_iter();
    lines.map(|line| format!("{indent}{line}")).collect()
}

/// Three heads, then a text for each row.
struct Strip {
    heads: [String; 3],
    cells: Vec<String>,
}

impl Strip {
    fn width(&self) -> usize {
        let texts = self.heads.iter().chain(&self.cells);
        texts.map(|text| text.chars().count()).max().unwrap_or(0) + GAP
    }
}

fn table(report: &Report) -> Vec<String> {
    let whole = Overview::of(report);
    let rows = shown_rows(&whole);
    let mut strips: Vec<Strip> = errors(report, &rows).into_iter().collect();
    let columns = whole.columns.iter().enumerate();
    strips.extend(columns.map(|(k, column)| strip(k, column, &rows)));
    let names: Vec<String> = rows
        .iter()
        .map(|row| format!("{} {}", row.joint, report.short_name(row.joint)))
        .collect();
    let names = Strip {
        heads: ["", "", "joint"].map(str::to_owned),
        cells: names,
    };
    let mut used = names.width();
    let fits = |strip: &&Strip| {
        used += strip.width();
        used <= WIDTH
    };
    let shown: Vec<&Strip> = strips.iter().take_while(fits).collect();
    let line = |name: &str, text: &dyn Fn(&Strip) -> String| {
        let texts = shown
            .iter()
            .map(|strip| format!("{:>1$}", text(strip), strip.width()));
        let line = format!("{name:<0$}{1}", names.width(), texts.collect::<String>());
        line.trim_end().to_owned()
    };
    let heads = (0..3).map(|k| line(&names.heads[k], &|strip| strip.heads[k].clone()));
    let lines = (0..rows.len()).map(|k| line(&names.cells[k], &|strip| strip.cells[k].clone()));
    let left_out = [
        (strips.len() - shown.len(), "effects"),
        (whole.rows.len() - rows.len(), "joints"),
    ];
    let left_out = left_out.into_iter().filter(|(count, _)| *count > 0);
    let left_out: Vec<String> = left_out
        .map(|(count, what)| format!("{count} more {what}"))
        .collect();
    let left_out =
        (!left_out.is_empty()).then(|| format!("  and {} in report.md", left_out.join(" and ")));
    let title = format!("What is missing?{}", key(&whole));
    let heads = [title].into_iter().chain(heads);
    heads.chain(lines).chain(left_out).collect()
}

/// What the marks of the table mean, as far as they occur.
fn key(whole: &Overview<'_>) -> String {
    let cells = || whole.rows.iter().flat_map(|row| row.cells.iter().flatten());
    let marks = [
        (
            cells().any(|held| held.standing == Standing::Supported),
            " ( ): supported, not established.",
        ),
        (
            cells().any(|held| held.side.is_some()),
            " > <: above, below joints built alike.",
        ),
    ];
    let marks = marks.into_iter().filter(|(occurs, _)| *occurs);
    marks.map(|(_, text)| text).collect()
}

/// All rows or, of more than fit, those that differ from like joints and then the first.
fn shown_rows<'t>(whole: &'t Overview<'t>) -> Vec<&'t Row<'t>> {
    let differs = |row: &Row<'_>| row.cells.iter().flatten().any(|held| held.side.is_some());
    let mut order: Vec<usize> = (0..whole.rows.len()).collect();
    order.sort_by_key(|k| !differs(&whole.rows[*k]));
    order.truncate(ROWS);
    order.sort_unstable();
    order.into_iter().map(|k| &whole.rows[k]).collect()
}

fn errors(report: &Report, rows: &[&Row<'_>]) -> [Strip; 2] {
    let errors = JointErrors::of(report);
    let JointErrors { about, unit, .. } = &errors;
    let (first, last) = about.split_once(' ').unwrap_or(("", about));
    let strip = |heads: [&str; 3], of: usize| Strip {
        heads: heads.map(str::to_owned),
        cells: rows
            .iter()
            .map(|row| two_digits(errors.pair(row.joint)[of]))
            .collect(),
    };
    [
        strip([first, last, "fitted"], 0),
        strip(["", unit, "effects"], 1),
    ]
}

fn strip(k: usize, column: &Column<'_>, rows: &[&Row<'_>]) -> Strip {
    let (first, last) = column.of.rsplit_once('_').unwrap_or(("", column.of));
    let more = if column.has_more { " etc." } else { "" };
    let symbol = if column.of == column.symbol {
        ""
    } else {
        &column.symbol
    };
    let unit = match column.unit {
        "1" => "",
        unit => unit,
    };
    let symbol = [&format!("{symbol}{more}"), unit];
    let symbol: Vec<&str> = symbol
        .into_iter()
        .map(|part| part.trim())
        .filter(|part| !part.is_empty())
        .collect();
    let cells = rows
        .iter()
        .map(|row| row.cells[k].as_ref().map_or_else(String::new, value));
    Strip {
        heads: [first.to_owned(), last.to_owned(), symbol.join(", ")],
        cells: cells.collect(),
    }
}

fn value(held: &Held<'_>) -> String {
    let number = two_digits(held.shown().value);
    let mark = match held.side {
        Some(Side::Above) => ">",
        Some(Side::Below) => "<",
        None => "",
    };
    match held.standing {
        Standing::Supported => format!("({number}){mark}"),
        Standing::Established | Standing::Declared => format!("{number}{mark}"),
    }
}

/// A number with two digits.
fn two_digits(x: f64) -> String {
    match x.abs() {
        size if (10.0..1e6).contains(&size) => format!("{x:.0}"),
        0.0 => "0".to_owned(),
        size if !(1e-4..1e6).contains(&size) => format!("{x:.1e}"),
        size => {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 1 to 5
            let digits = (1.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
            format!("{x:.digits$}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::two_digits;

    #[test]
    fn numbers_have_two_digits() {
        let numbers = [0.351, 0.0102, 1.4, 53.2, -0.266, 0.0, 2e-5];
        let expected = ["0.35", "0.010", "1.4", "53", "-0.27", "0", "2.0e-5"];
        assert_eq!(numbers.map(two_digits), expected);
    }
}
