//! The table as Markdown.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::table::{Compared, Entry, Row, Summary};

/// Errors after closing the loop that are at most this share of the best other error are clearly better.
const CLEARLY: f64 = 0.9;
/// A network may raise the error after closing the loop by up to this factor.
const NETWORK: f64 = 1.02;

/// The summary as Markdown.
pub fn markdown(summary: &Summary) -> String {
    let mut text = String::from(
        "Open-loop position error 0.5 s ahead on logs left out of the fit, in mrad: root mean square over all rows \
         of all windows and all joints; the median window in brackets.\n\n\
         | rig | fits | declared | declared, fitted | usual friction | plain structure | published | mujoco.sysid | after | hybrid | after / best of \
         the others | hybrid / after | s a fit |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    summary.rows.iter().for_each(|row| push_row(&mut text, row));
    text += &totals(&summary.rows);
    text += "\n| rig | named (fits) | verdict (fits) |\n|---|---|---|\n";
    for row in &summary.rows {
        let (named, verdicts) = (listed(&row.named), listed(&row.verdicts));
        let _ = writeln!(text, "| {} | {named} | {verdicts} |", row.name());
    }
    push_folds(&mut text, &summary.folds);
    for (method, reason) in &summary.not_run {
        let _ = writeln!(text, "\nNot run: {}: {reason}", method.name());
    }
    if !summary.failures.is_empty() {
        text += "\n| failed | what | error |\n|---|---|---|\n";
    }
    for (fold, method, error) in &summary.failures {
        let _ = writeln!(text, "| {fold} | {} | {error} |", method.name());
    }
    text
}

/// The folds, with simpler models that are better by more than noise in bold.
fn push_folds(text: &mut String, folds: &[Compared]) {
    *text += "\n| rig, fold | after | simpler; **better than after by more than noise** |\n|---|---|---|\n";
    for fold in folds {
        let simpler = fold.simpler.iter().map(|simpler| {
            let said = format!("{}: {}", simpler.model, mrad(simpler.error));
            match simpler.is_better() {
                true => format!("**{said}**"),
                false => said,
            }
        });
        let simpler: Vec<String> = simpler.collect();
        let after = mrad(fold.after);
        let _ = writeln!(
            text,
            "| {}, {} | {after} | {} |",
            fold.rig,
            fold.fold,
            simpler.join(", ")
        );
    }
}

fn push_row(text: &mut String, row: &Row) {
    let of = |model: &str| {
        let entry = row.models.iter().find(|entry| entry.model == model);
        entry.map_or("-".to_owned(), cell)
    };
    let sets = row.models.iter().filter_map(|entry| {
        let name = entry.model.strip_prefix("published ")?;
        Some(format!("{name}: {}", cell(entry)))
    });
    let sets: Vec<String> = sets.collect();
    let ratio = |ratio: Option<f64>| ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.2}"));
    let _ = writeln!(
        text,
        "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
        row.name(),
        row.folds,
        of("declared"),
        of("declared, fitted"),
        of("usual friction"),
        of("plain structure"),
        sets.join(", "),
        of("mujoco.sysid"),
        of("after"),
        of("hybrid"),
        ratio(row.ratio),
        ratio(row.hybrid_ratio),
        row.seconds
            .map_or("-".to_owned(), |seconds| format!("{seconds:.0}"))
    );
}

/// `31.2 (6.1)`; if folds failed, their number, since the rest is not an error over all test logs.
fn cell(entry: &Entry) -> String {
    match (entry.failed, entry.error(), entry.middle()) {
        (0, Some(rms), Some(middle)) => {
            let [rms, median] = [rms, middle.position_median].map(mrad);
            format!("{rms} ({median})")
        }
        (0, ..) => "-".to_owned(),
        (failed, ..) => format!("{failed} failed"),
    }
}

fn mrad(rad: f64) -> String {
    match 1e3 * rad {
        small if small < 10.0 => format!("{small:.2}"),
        middle if middle < 100.0 => format!("{middle:.1}"),
        large => format!("{large:.0}"),
    }
}

impl Summary {
    /// The answer in a sentence.
    pub fn headline(&self) -> String {
        format!(
            "closing the loop is as good as the best of the others on {} of {} rigs",
            reached(&self.rows, |row| row.ratio, 1.0),
            self.rows.len()
        )
    }
}

/// In how many rows a ratio is at most this; a row without one counts as not reached.
fn reached(rows: &[Row], ratio: fn(&Row) -> Option<f64>, most: f64) -> usize {
    let reaches = |row: &&Row| ratio(row).is_some_and(|ratio| ratio <= most);
    rows.iter().filter(reaches).count()
}

fn totals(rows: &[Row]) -> String {
    format!(
        "\nOf {} rows: error after at most that of the best of the others (usual friction, plain structure, published sets, mujoco.sysid) in {}, at \
         most {CLEARLY} of it in {}; error with the network at most {NETWORK} of the error after in {}.\n",
        rows.len(),
        reached(rows, |row| row.ratio, 1.0),
        reached(rows, |row| row.ratio, CLEARLY),
        reached(rows, |row| row.hybrid_ratio, NETWORK)
    )
}

/// `coulomb_friction@1 (4), viscous_friction@1 (2)`, the most frequent first.
fn listed(counts: &BTreeMap<String, usize>) -> String {
    let mut all: Vec<(&String, &usize)> = counts.iter().collect();
    all.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
    let message: Vec<String> = all
        .into_iter()
        .map(|(what, count)| format!("{what} ({count})"))
        .collect();
    if message.is_empty() {
        "nothing".to_owned()
    } else {
        message.join(", ")
    }
}
