//! Lines of the file that a model was read from.

use std::path::Path;

use crate::model::reader::{Document, FileError, Section};
use crate::model::system::Model;

/// The file's text, read once more as tables.
pub(super) struct Places {
    document: Document,
}

impl Places {
    pub fn of(model: &Model) -> Self {
        Self {
            document: Document::new(Path::new(&model.name), &model.text),
        }
    }

    /// The line of a byte of the text.
    pub fn line(&self, at: usize) -> Option<usize> {
        line_of(&self.document.error(at, ""))
    }

    pub fn parameter(&self, name: &str) -> Option<usize> {
        let top = self.document.parse().ok()?;
        line_at(&top.section("parameters").ok()??, name)
    }

    pub fn intermediate(&self, name: &str) -> Option<usize> {
        let top = self.document.parse().ok()?;
        let dynamics = top.section("dynamics").ok()??;
        line_at(&dynamics.section("let").ok()??, name)
    }

    /// The k-th effect.
    pub fn effect(&self, k: usize) -> Option<usize> {
        let effects = self.document.parse().ok()?.sections("effect").ok()?;
        line_of(&effects.get(k)?.error(""))
    }
}

fn line_at(section: &Section<'_>, key: &str) -> Option<usize> {
    line_of(&section.error_at(key, ""))
}

fn line_of(error: &FileError) -> Option<usize> {
    error.place.map(|(line, _)| line)
}
