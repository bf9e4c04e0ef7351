//! Tables of cases: a case a line, its cells between bars.

use super::says;

/// The rows of a table. In a cell, `\n` stands for a new line.
#[track_caller]
pub fn rows<const CELLS: usize>(table: &str) -> Vec<[String; CELLS]> {
    let lines = table.lines().filter(|line| !line.trim().is_empty());
    let row = |line: &str| {
        let cells = line.split('|').map(|cell| cell.trim().replace("\\n", "\n"));
        let cells: Vec<String> = cells.collect();
        let cells = cells.try_into();
        cells.unwrap_or_else(|_| panic!("not {CELLS} cells: {line}"))
    };
    lines.map(row).collect()
}

/// The message must contain each of the words between `...`.
#[track_caller]
pub fn says_words(message: &str, words: &str) {
    says(message, &words.split(" ... ").collect::<Vec<_>>());
}

/// A table of effects, their joints and their values, as it stands in a model file.
#[track_caller]
pub fn effects(table: &str) -> String {
    let effect = |[name, joint, values]: [String; 3]| {
        format!("\n[[effect]]\nname = \"{name}\"\njoint = {joint}\n{values}\n")
    };
    rows(table).into_iter().map(effect).collect()
}
