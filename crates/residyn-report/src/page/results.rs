//! The page of an experiment or of the bench: its answer, its tables and figures, and how it was made.

use std::path::PathBuf;

use maud::{Markup, PreEscaped, html};
use pulldown_cmark::html::push_html;
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};
use serde_json::Value;

use super::blocks::percent;
use super::framed;
use crate::document::{Block, Document, Section, of_call};
use crate::json::PAGE;
use crate::wording::capitalised;
use residyn_core::model::Call;
use residyn_io::runs::{RunFolder, RunFolderError};
use residyn_plot::Share;

/// The page of an experiment or of the bench.
pub struct ResultsPage<'a> {
    /// What was done, in a few words.
    pub what: &'a str,
    /// The answer in a sentence, without a full stop.
    pub headline: &'a str,
    /// Tables and remarks in Markdown.
    pub text: &'a str,
    /// How often something held, drawn as intervals.
    pub shares: Vec<Share>,
    /// A complete SVG document.
    pub figure: Option<&'a str>,
    /// None if every part has its own.
    pub seed: Option<u64>,
    /// As resolved.
    pub configuration: &'a Value,
    pub call: &'a Call,
}

impl ResultsPage<'_> {
    /// Write the page into a folder, one file that needs no network, and return its path.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, folder: &RunFolder) -> Result<PathBuf, RunFolderError> {
        folder.write_text(PAGE, &self.html())?;
        Ok(folder.path().join(PAGE))
    }

    fn html(&self) -> String {
        let answer = Block::Drawn {
            page: html! { (shown(self)) (markdown(self.text)) },
            files: &[],
        };
        let document = Document {
            about: self.what.to_owned(),
            headline: capitalised(self.headline),
            head: Vec::new(),
            sections: vec![
                Section {
                    id: "came",
                    question: "What came out?",
                    answer: vec![answer],
                },
                of_call(self.call, self.seed, self.configuration),
            ],
        };
        framed(&document, &html! {})
    }
}

fn shown(results: &ResultsPage<'_>) -> Markup {
    html! {
        @if let Some(figure) = results.figure { div.figure tabindex="0" { (PreEscaped(figure)) } }
        @if !results.shares.is_empty() {
            p.small { "Shares with their 95 % intervals." }
            @for Share { what, share, interval: [low, high] } in &results.shares {
                div.share style={ "--low:" (percent(*low)) ";--high:" (percent(*high)) ";--at:" (percent(*share)) } {
                    span { (what) }
                    span.track { i {} b {} }
                    span { (format!("{:.0} %", 100.0 * share)) }
                }
            }
        }
    }
}

/// Wide tables scroll by themselves, and anything that looks like HTML is text.
fn markdown(text: &str) -> Markup {
    let events = Parser::new_ext(text, Options::ENABLE_TABLES).flat_map(|event| match event {
        Event::Start(Tag::Table(_)) => vec![
            Event::Html("<div class=\"table\" tabindex=\"0\">".into()),
            event,
        ],
        Event::End(TagEnd::Table) => vec![event, Event::Html("</div>".into())],
        Event::Html(text) | Event::InlineHtml(text) => vec![Event::Text(text)],
        event => vec![event],
    });
    let mut out = String::new();
    push_html(&mut out, events);
    PreEscaped(out)
}

#[cfg(test)]
mod tests {
    use super::markdown;

    #[test]
    fn tables_scroll_and_markup_is_text() {
        let set = markdown("| a |\n|---|\n| 1 <b> |\n").into_string();
        assert!(
            set.starts_with("<div class=\"table\" tabindex=\"0\"><table>"),
            "{set}"
        );
        assert!(set.contains("<td>1 &lt;b&gt;</td>"), "{set}");
    }
}
