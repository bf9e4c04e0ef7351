//! The blocks of a document as HTML.

use maud::{Markup, PreEscaped, html};

use super::maths::formula;
use crate::document::{Block, Cell, Table};

pub(super) fn shown(blocks: &[Block]) -> Markup {
    html! { @for block in blocks { (of(block)) } }
}

fn of(block: &Block) -> Markup {
    html! {
        @match block {
            Block::Heading(text) => h3 { (marked(text)) },
            Block::Paragraph(text) => p { (marked(text)) },
            Block::Small(text) => p.small { (marked(text)) },
            Block::Serious(text) => p.serious { (marked(text)) },
            Block::List(items) => ul { @for item in items { li { (marked(item)) } } },
            Block::Steps(items) => ol { @for item in items { li { (marked(item)) } } },
            Block::Table(rows) => (table(rows)),
            Block::Code(text) => pre tabindex="0" { (text) },
            Block::Formula { latex, .. } => (formula(latex)),
            Block::Boxed(name, blocks) => div class=(name) { (shown(blocks)) },
            Block::Folded { about, is_open, blocks } => details open[*is_open] { summary { (about) } (shown(blocks)) },
            Block::Part { id, about, blocks } => details.part { summary { (about) } div id=(id) { (shown(blocks)) } },
            Block::Drawn { page, .. } => (page),
        }
    }
}

fn table(table: &Table) -> Markup {
    html! {
        div.table tabindex="0" { table {
            thead { tr { @for head in &table.heads { th { (breakable(head)) } } } }
            tbody {
                @for row in &table.rows {
                    @let (names, values) = row.split_at(table.labels);
                    tr {
                        @for name in names { (row_name(name)) }
                        @for value in values { (cell(value)) }
                    }
                }
            }
        } }
    }
}

fn row_name(
    Cell {
        text, class, part, ..
    }: &Cell,
) -> Markup {
    html! {
        th scope="row" class=[class] {
            @match part {
                Some(id) => a href={ "#" (id) } { (marked(text)) },
                None => (marked(text)),
            }
        }
    }
}

fn cell(
    Cell {
        text,
        class,
        hint,
        bar,
        ..
    }: &Cell,
) -> Markup {
    html! {
        @match bar {
            Some(share) => {
                td.ratio {
                    span.bar.worse[*share > 1.0] style={ "--share:" (percent(*share)) } { (text) }
                }
            }
            None => td class=[class] title=[hint] { (marked(text)) },
        }
    }
}

/// A length in CSS, at most the whole.
pub(super) fn percent(share: f64) -> String {
    format!("{:.1}%", 100.0 * share.clamp(0.0, 1.0))
}

/// A head that may break after each part of a long name.
fn breakable(head: &str) -> Markup {
    let set = marked(head).into_string();
    PreEscaped(set.replace('_', "_<wbr>"))
}

/// A text with its marks.
fn marked(text: &str) -> Markup {
    html! {
        @for (k, part) in text.split('`').enumerate() {
            @if k % 2 == 1 { code { (part) } } @else {
                @for (k, part) in part.split("**").enumerate() {
                    @if k % 2 == 1 { strong { (part) } } @else { (part) }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::marked;

    #[test]
    fn marks_are_set_and_markup_is_text() {
        let set = marked("**a<b.csv**: `x ** y`, z").into_string();
        assert_eq!(set, "<strong>a&lt;b.csv</strong>: <code>x ** y</code>, z");
    }
}
