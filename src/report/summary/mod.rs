//! The answer for a terminal, in at most thirty lines of eighty characters: the story of `report.html`, question by question.

mod better;
mod curves;
mod trust;

use std::path::Path;

use super::json::PAGE;
use super::schema::{EffectEntry, Report};
use super::wording::values;
use crate::closeloop::Stage;
use crate::layout::wrap;

pub use self::curves::curves;

const WIDTH: usize = 80;
const LINES: usize = 30;
/// Lines about effects at most, and about what to do next.
const EFFECTS: usize = 5;
const NEXT: usize = 3;

/// The answer in a line.
pub fn answer(report: &Report) -> String {
    format!("{}: {}", report.headline, report.reason)
}

/// The answer for a terminal: a few lines, and where the rest is. `seconds` is how long each stage took; `drawn` are [`curves`],
/// or none, and stand where there is room for them.
pub fn summary(
    report: &Report,
    seconds: &[(Stage, f64)],
    folder: &Path,
    drawn: &[String],
) -> String {
    let mut lines = [head(report), missing(report), better::lines(report)].concat();
    let trust = trust::lines(report);
    let room = LINES - 1 - lines.len() - trust.len();
    let next = paragraph("", &next(report, folder), room.min(NEXT));
    if drawn.len() + next.len() <= room {
        lines.extend_from_slice(drawn);
    }
    let rest = [trust, next, vec![files(seconds, folder)]].concat();
    lines.extend(rest);
    lines.join("\n") + "\n"
}

/// What is serious about the logs, then the answer.
fn head(report: &Report) -> Vec<String> {
    let mut serious = report.serious();
    let first = serious.next().map(|(log, finding)| {
        let more = match serious.count() {
            0 => String::new(),
            more => format!(" (and {more} more in report.md)"),
        };
        format!("Serious, to be mended first{more}: {log}: {finding}")
    });
    let first = first.map_or_else(Vec::new, |text| paragraph("", &text, 3));
    [first, paragraph("", &answer(report), 3)].concat()
}

/// The effects with their sizes; one line each where there are many.
fn missing(report: &Report) -> Vec<String> {
    if report.effects.is_empty() {
        return Vec::new();
    }
    let sizes = |effect: &EffectEntry| values(&effect.parameters).join(", ");
    let named = |effect: &EffectEntry| format!("{} on joint {}", effect.title, effect.place);
    let whole = report.effects.iter().flat_map(|effect| {
        let added = format!("{}: {}", named(effect), effect.expression);
        [
            paragraph("  ", &added, 2),
            paragraph("    ", &sizes(effect), EFFECTS),
        ]
        .concat()
    });
    let mut lines: Vec<String> = whole.collect();
    if lines.len() > EFFECTS {
        let one = |effect: &EffectEntry| cut(&format!("  {}: {}", named(effect), sizes(effect)));
        lines = listed(report.effects.iter().map(one).collect(), EFFECTS, "effects");
    }
    [vec!["What is missing?".to_owned()], lines].concat()
}

/// What to do next.
fn next(report: &Report, folder: &Path) -> String {
    let told = if report.serious().next().is_some() {
        "mend the logs; `residyn audit` says how".to_owned()
    } else if let Some(rival) = report.alternatives.first() {
        format!("to rule out {}: {}", rival.title, rival.experiment)
    } else {
        let model = folder.join(&report.files.model);
        format!(
            "predict another log: residyn evaluate --model {} --test LOG",
            model.display()
        )
    };
    format!("What next? {told}")
}

/// Where the rest is; a path is never cut.
fn files(seconds: &[(Stage, f64)], folder: &Path) -> String {
    let all: f64 = seconds.iter().map(|(_, seconds)| seconds).sum();
    let page = folder.join(PAGE);
    format!(
        "Took {all:.1} s. Open {}; model and plots are beside it",
        page.display()
    )
}

/// At most this many lines, the last of which says how many more there are.
fn listed(mut lines: Vec<String>, most: usize, what: &str) -> Vec<String> {
    if lines.len() > most {
        let more = lines.len() - (most - 1);
        lines.truncate(most - 1);
        lines.push(format!("  and {more} more {what} in report.md"));
    }
    lines
}

/// A text in lines with an indent, of which the last ends in dots where there would be more than `most`.
fn paragraph(indent: &str, text: &str, most: usize) -> Vec<String> {
    let mut lines = wrap(text, WIDTH - indent.len());
    if lines.len() > most {
        let rest = lines.split_off(most - 1).join(" ");
        lines.push(rest);
    }
    let lines = lines
        .into_iter()
        .map(|line| cut(&format!("{indent}{line}")));
    lines.collect()
}

/// A line that ends in dots where it would be too long.
fn cut(line: &str) -> String {
    match line.chars().count() > WIDTH {
        true => line.chars().take(WIDTH - 3).chain("...".chars()).collect(),
        false => line.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::{WIDTH, cut, listed, paragraph};

    #[test]
    fn what_is_too_long_ends_in_dots() {
        assert_eq!(cut("short"), "short");
        let long = cut(&"x".repeat(100));
        assert!(
            long.ends_with("x...") && long.chars().count() == WIDTH,
            "{long}"
        );
        let words = "word ".repeat(60);
        let lines = paragraph("  ", &words, 2);
        assert_eq!(lines.len(), 2);
        assert!(lines[1].ends_with("..."), "{lines:?}");
        assert_eq!(paragraph("", "one two", 2), ["one two"]);
        let numbered = |n: usize| (0..n).map(|k| k.to_string()).collect::<Vec<_>>();
        assert_eq!(listed(numbered(3), 3, "things"), ["0", "1", "2"]);
        let more = "  and 3 more things in report.md";
        assert_eq!(listed(numbered(5), 3, "things"), ["0", "1", more]);
    }
}
