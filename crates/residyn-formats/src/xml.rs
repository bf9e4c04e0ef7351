//! Reads XML; every error names file, line and column.

mod crowd;

use std::cell::RefCell;
use std::fmt;
use std::path::{Path, PathBuf};

use roxmltree::{Document, Error, Node};

use super::robot::element::Element;
use residyn_core::limits::XML_DEPTH;
use residyn_core::model::FileError;
use residyn_io::files::read_text;

/// An XML file, and notes about it.
pub(crate) struct Source<'x> {
    path: PathBuf,
    document: Document<'x>,
    /// By byte position.
    notes: RefCell<Vec<(usize, String)>>,
}

/// The text of a file.
pub(crate) fn text(path: &Path) -> Result<String, FileError> {
    read_text(path).map_err(|error| {
        let message = format!("cannot be read: {error}; give an XML file");
        FileError::new(path, None, message)
    })
}

impl<'x> Source<'x> {
    pub fn new(path: &Path, text: &'x str) -> Result<Self, FileError> {
        crowd::check(path, text)?;
        let document = Document::parse(text).map_err(|error| {
            let message = format!("this is not valid XML: {error}");
            FileError::new(path, Some(place(&error, text)), message)
        })?;
        let source = Self {
            path: path.to_owned(),
            document,
            notes: RefCell::default(),
        };
        match too_deep(source.document_root(), XML_DEPTH) {
            None => Ok(source),
            Some(node) => {
                let message =
                    format!("is nested in more than {XML_DEPTH} elements; flatten the file");
                Err(source.error(node, message))
            }
        }
    }

    /// Note something about an element that is not an error.
    pub fn note(&self, node: Node<'_, '_>, message: impl fmt::Display) {
        self.note_at(node.range().start, message);
    }

    /// As above, for what begins at this byte position.
    pub fn note_at(&self, at: usize, message: impl fmt::Display) {
        self.notes.borrow_mut().push((at, message.to_string()));
    }

    /// All notes, in the order of the file.
    pub fn into_notes(self) -> Vec<String> {
        let mut notes = self.notes.into_inner();
        notes.sort();
        let (text, mut line, mut from) = (self.document.input_text(), 1, 0);
        let placed = notes.into_iter().map(|(at, note)| {
            line += text[from..at].matches('\n').count();
            from = at;
            (line, note)
        });
        let mut placed: Vec<(usize, String)> = placed.collect();
        placed.sort();
        placed.dedup();
        placed
            .into_iter()
            .map(|(line, note)| format!("line {line}: {note}"))
            .collect()
    }

    /// The root element, which must have this name.
    pub fn root(&self, name: &str) -> Result<Node<'_, 'x>, FileError> {
        let root = self.document_root();
        if root.has_tag_name(name) {
            return Ok(root);
        }
        let found = root.tag_name().name();
        let format = match found {
            "robot" => "; this is URDF, read it as urdf",
            "mujoco" => "; this is MJCF, read it as mjcf",
            _ => "",
        };
        let message = format!("the root element is <{found}>, expected <{name}>{format}");
        Err(self.error(root, message))
    }

    /// The root element, whatever its name.
    pub fn document_root(&self) -> Node<'_, 'x> {
        self.document.root_element()
    }

    /// An element without defaults.
    pub fn element<'s>(&'s self, node: Node<'s, 'x>) -> Element<'s, 'x> {
        Element::new(self, vec![node])
    }

    /// The file name without folder and extension.
    pub fn stem(&self) -> String {
        let stem = self.path.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    }

    /// An error at an element.
    pub fn error(&self, node: Node<'_, '_>, message: impl Into<String>) -> FileError {
        self.error_at(node.range().start, message)
    }

    /// An error at a position, in bytes from the beginning of the file.
    pub fn error_at(&self, at: usize, message: impl Into<String>) -> FileError {
        let place = self.document.text_pos_at(at);
        let place = (place.row as usize, place.col as usize);
        FileError::new(&self.path, Some(place), message)
    }

    /// An error at an attribute of an element.
    pub fn attribute_error(
        &self,
        node: Node<'_, '_>,
        key: &str,
        message: impl Into<String>,
    ) -> FileError {
        let attribute = node.attribute_node(key);
        let at = attribute.map_or(node.range().start, |a| a.range_value().start);
        self.error_at(at, message)
    }
}

/// The first element that is more than `most` levels deep, the given one being the first level.
fn too_deep<'a, 'x>(node: Node<'a, 'x>, most: usize) -> Option<Node<'a, 'x>> {
    match most.checked_sub(1) {
        None => Some(node),
        Some(most) => elements(node).find_map(|child| too_deep(child, most)),
    }
}

/// Line and column: an unclosed element is reported at the end of the file.
fn place(error: &Error, text: &str) -> (usize, usize) {
    if matches!(error, Error::UnclosedRootNode) {
        let last = text.lines().last().unwrap_or_default();
        return (text.lines().count(), last.chars().count() + 1);
    }
    (error.pos().row as usize, error.pos().col as usize)
}

/// The child elements.
pub(crate) fn elements<'a, 'x>(node: Node<'a, 'x>) -> impl Iterator<Item = Node<'a, 'x>> {
    node.children().filter(Node::is_element)
}

/// The child elements of one name.
pub(crate) fn named<'a, 'x>(
    node: Node<'a, 'x>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'x>> {
    elements(node).filter(move |child| child.has_tag_name(name))
}

/// Text that can stand in an element or an attribute.
pub(super) fn escaped(text: &str) -> String {
    let text = text
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;");
    text.replace('"', "&quot;").replace(['\n', '\r', '\t'], " ")
}
