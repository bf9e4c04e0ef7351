//! The answer for a terminal, in about thirty lines of eighty characters (of a hundred for a rig of many joints): the story of `report.html`, question by
//! question. Sentences are wrapped and never cut; long lists show their first entries.

mod better;
mod curves;
mod large;
mod trust;

use std::path::Path;

use super::document::values;
use super::json::PAGE;
use super::overview::is_large;
use super::schema::{EffectEntry, Report};
use residyn_core::closeloop::Stage;
use residyn_core::data::{Finding, Remedy, together};
use residyn_core::layout::wrap;

pub use self::curves::curves;

const WIDTH: usize = 80;
/// With more lines than this no curves are drawn.
const LINES: usize = 30;
/// Most lines about effects; beyond that, each effect gets one line.
const EFFECTS: usize = 5;

/// How the program that shows an answer words what its reader can do.
pub struct Words<'w> {
    /// What fixes a finding about a log.
    pub remedy: &'w dyn Fn(&Remedy) -> String,
    /// Predict another log with a model file.
    pub predict: &'w dyn Fn(&Path) -> String,
}

impl Default for Words<'_> {
    fn default() -> Self {
        Self {
            remedy: &Remedy::to_string,
            predict: &|model| format!("predict another log with {}", model.display()),
        }
    }
}

/// The answer in a line.
pub fn answer(report: &Report) -> String {
    format!("{}: {}", report.headline, report.reason)
}

/// The answer for a terminal: a few lines, and where the rest is. `seconds` is how long each stage took; `drawn` are [`curves`],
/// or none, and appear if there is room for them.
pub fn summary(
    report: &Report,
    seconds: &[(Stage, f64)],
    folder: &Path,
    drawn: &[String],
    words: &Words<'_>,
) -> String {
    if is_large(report.joints) {
        return large::summary(report, seconds, folder, words);
    }
    let mut lines = [head(report, words), missing(report), better::lines(report)].concat();
    let rest = [
        trust::lines(report),
        paragraph("", &next(report, folder, words)),
        vec![files(seconds, folder)],
    ]
    .concat();
    if lines.len() + drawn.len() + rest.len() <= LINES {
        lines.extend_from_slice(drawn);
    }
    lines.extend(rest);
    lines.join("\n") + "\n"
}

/// What is serious about the logs, then the answer.
fn head(report: &Report, words: &Words<'_>) -> Vec<String> {
    let serious = serious(report, words).map_or_else(Vec::new, |text| paragraph("", &text));
    [serious, paragraph("", &answer(report))].concat()
}

/// The first of the findings that make results wrong.
fn serious(report: &Report, words: &Words<'_>) -> Option<String> {
    let serious = report.serious();
    let said = |(log, finding): (&str, &Finding)| (log.to_owned(), finding.message(words.remedy));
    let serious = together(serious.map(said));
    serious.first().map(|first| {
        let more = match serious.len() - 1 {
            0 => String::new(),
            more => format!(" (and {more} more in report.md)"),
        };
        let about = first.about(report.audit.len());
        format!("Serious, to be fixed first{more}: {about}: {}", first.text)
    })
}

/// The effects with their sizes; one line each if there are many.
fn missing(report: &Report) -> Vec<String> {
    if report.effects.is_empty() {
        return Vec::new();
    }
    let sizes = |effect: &EffectEntry| values(&effect.parameters).replace('`', "");
    let whole = report.effects.iter().flat_map(|effect| {
        let added = format!("{}: {}", effect.named(), effect.expression);
        [paragraph("  ", &added), paragraph("    ", &sizes(effect))].concat()
    });
    let mut lines: Vec<String> = whole.collect();
    if report.effects.len() > 1 && lines.len() > EFFECTS {
        let one = |effect: &EffectEntry| format!("{}: {}", effect.named(), sizes(effect));
        let each = report.effects.iter().map(one).collect();
        let first = listed(each, EFFECTS, "effects");
        lines = first
            .iter()
            .flat_map(|effect| paragraph("  ", effect))
            .collect();
    }
    [vec!["What is missing?".to_owned()], lines].concat()
}

const FIX_LOGS: &str = "fix the logs; `residyn audit` says how";

/// What to do next.
fn next(report: &Report, folder: &Path, words: &Words<'_>) -> String {
    let message = if report.serious().next().is_some() {
        FIX_LOGS.to_owned()
    } else if let Some(rival) = report.alternatives.first() {
        format!("to rule out {}: {}", rival.title, rival.experiment)
    } else {
        (words.predict)(&folder.join(&report.files.model))
    };
    format!("What next? {message}")
}

/// Where the rest is; a path is never cut.
fn files(seconds: &[(Stage, f64)], folder: &Path) -> String {
    let all: f64 = seconds.iter().map(|(_, seconds)| seconds).sum();
    let page = folder.join(PAGE);
    format!(
        "Took {all:.1} s. Open {}; model and plots are next to it",
        page.display()
    )
}

/// At most this many entries, the last of which says how many more there are.
fn listed(mut entries: Vec<String>, most: usize, what: &str) -> Vec<String> {
    if entries.len() > most {
        let more = entries.len() - (most - 1);
        entries.truncate(most - 1);
        entries.push(format!("  and {more} more {what} in report.md"));
    }
    entries
}

/// A text in lines with an indent.
fn paragraph(indent: &str, text: &str) -> Vec<String> {
    let lines = wrap(text, WIDTH - indent.len()).into_iter();
    lines.map(|line| format!("{indent}{line}")).collect()
}

#[cfg(test)]
mod tests {
    use super::{WIDTH, listed, paragraph};

    #[test]
    fn what_is_too_long_is_broken_and_not_cut() {
        let words = "word ".repeat(60);
        let lines = paragraph("  ", &words);
        assert!(lines.iter().all(|line| line.chars().count() <= WIDTH));
        assert_eq!(lines.join(" ").split_whitespace().count(), 60);
        assert_eq!(paragraph("", "one two"), ["one two"]);
        let numbered = |n: usize| (0..n).map(|k| k.to_string()).collect::<Vec<_>>();
        assert_eq!(listed(numbered(3), 3, "things"), ["0", "1", "2"]);
        let more = "  and 3 more things in report.md";
        assert_eq!(listed(numbered(5), 3, "things"), ["0", "1", more]);
    }
}
