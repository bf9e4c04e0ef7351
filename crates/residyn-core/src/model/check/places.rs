//! Lines of the file that a model was read from.

use std::collections::HashMap;
use std::path::Path;

use crate::model::reader::{Document, Section};
use crate::model::system::Model;

/// The file's text, and the byte offsets of its entries.
pub(super) struct Places {
    document: Document,
    parameters: HashMap<String, usize>,
    intermediates: HashMap<String, usize>,
    effects: Vec<usize>,
}

impl Places {
    pub fn of(model: &Model) -> Self {
        let mut places = Self {
            document: Document::new(Path::new(&model.name), &model.text),
            parameters: HashMap::new(),
            intermediates: HashMap::new(),
            effects: Vec::new(),
        };
        if let Ok(top) = places.document.parse() {
            let section = |key| top.section(key).ok().flatten();
            let dynamics = section("dynamics");
            let lets = dynamics.and_then(|dynamics| dynamics.section("let").ok().flatten());
            let (parameters, lets) = (all(section("parameters")), all(lets));
            let effects = top.sections("effect").unwrap_or_default();
            let effects = effects.iter().map(|effect| effect.at).collect();
            (places.parameters, places.intermediates, places.effects) = (parameters, lets, effects);
        }
        places
    }

    /// The line of a byte offset in the text.
    pub fn line(&self, at: usize) -> Option<usize> {
        self.document.error(at, "").place.map(|(line, _)| line)
    }

    pub fn parameter(&self, name: &str) -> Option<usize> {
        self.line(*self.parameters.get(name)?)
    }

    pub fn intermediate(&self, name: &str) -> Option<usize> {
        self.line(*self.intermediates.get(name)?)
    }

    /// The line of the k-th effect.
    pub fn effect(&self, k: usize) -> Option<usize> {
        self.line(*self.effects.get(k)?)
    }
}

/// The places of a section's entries, by name.
fn all(section: Option<Section<'_>>) -> HashMap<String, usize> {
    let places = section.iter().flat_map(|section| section.places());
    places.map(|(key, at)| (key.to_owned(), at)).collect()
}
