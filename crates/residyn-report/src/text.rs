//! `report.md`: the document in Markdown.

use super::document::{Block, Document, Table, document};
use super::schema::Report;

/// The report in Markdown, question by question.
pub fn text(report: &Report) -> String {
    let Document {
        about,
        headline,
        head,
        sections,
    } = document(report);
    let sections = sections
        .iter()
        .map(|section| format!("## {}\n\n{}", section.question, all(&section.answer, TOP)));
    let whole =
        format!("# {about}: {headline}\n\n{}", all(&head, TOP)) + &sections.collect::<String>();
    whole.trim_end().to_owned() + "\n"
}

/// The level of headings below a section's.
const TOP: usize = 3;

fn all(blocks: &[Block], level: usize) -> String {
    blocks.iter().map(|block| markdown(block, level)).collect()
}

fn markdown(block: &Block, level: usize) -> String {
    let heading = |text: &str| format!("{} {text}\n\n", "#".repeat(level));
    match block {
        Block::Heading(text) => heading(text),
        Block::Paragraph(text) | Block::Small(text) | Block::Serious(text) => {
            format!("{text}\n\n")
        }
        Block::List(items) => listed(items, |_| "-".to_owned()),
        Block::Steps(items) => listed(items, |k| format!("{}.", k + 1)),
        Block::Table(rows) => table(rows),
        Block::Code(text) => format!("```text\n{}\n```\n\n", text.trim_end()),
        Block::Formula { latex, plain } => match plain {
            Some(plain) => format!("`{plain}`\n\n"),
            None => format!("$$\n{latex}\n$$\n\n"),
        },
        Block::Boxed(_, blocks) => all(blocks, level),
        Block::Part { about, blocks, .. } => heading(about) + &all(blocks, level + 1),
        Block::Folded { about, blocks, .. } => format!("**{about}**\n\n{}", all(blocks, level)),
        Block::Drawn { files, .. } => {
            let picture = |file: &&str| format!("![{}]({file})\n\n", file.trim_end_matches(".svg"));
            files.iter().map(picture).collect()
        }
    }
}

fn listed(items: &[String], mark: impl Fn(usize) -> String) -> String {
    let items = items.iter().enumerate();
    let lines = items.map(|(k, item)| format!("{} {item}\n", mark(k)));
    lines.collect::<String>() + "\n"
}

fn table(table: &Table) -> String {
    let heads = row(table.heads.iter().map(String::as_str));
    let rows = table.rows.iter();
    let rows = rows.map(|cells| row(cells.iter().map(|cell| cell.text.as_str())));
    let rule = "|---".repeat(table.heads.len());
    format!("{heads}{rule}|\n{}\n", rows.collect::<String>())
}

/// A bar in a cell would end it.
fn row<'t>(cells: impl Iterator<Item = &'t str>) -> String {
    let cells: Vec<String> = cells.map(|text| text.replace('|', "\\|")).collect();
    format!("| {} |\n", cells.join(" | "))
}

#[cfg(test)]
mod tests {
    #[test]
    fn bars_in_cells_do_not_end_them() {
        let row = super::row(["a|b.csv", "1"].into_iter());
        assert_eq!(row, "| a\\|b.csv | 1 |\n");
    }
}
