//! XML whose every error names file, line and column.

use std::cell::RefCell;
use std::f64::consts::PI;
use std::fmt;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use roxmltree::{Document, Node};

use crate::model::FileError;

/// An XML file, and notes about it.
pub(in crate::formats) struct Source<'x> {
    path: PathBuf,
    document: Document<'x>,
    notes: RefCell<Vec<(u32, String)>>,
}

/// The text of a file.
pub(in crate::formats) fn text(path: &Path) -> Result<String, FileError> {
    std::fs::read_to_string(path).map_err(|error| FileError {
        path: path.to_owned(),
        place: None,
        message: format!("cannot be read: {error}; give an XML file"),
    })
}

impl<'x> Source<'x> {
    pub fn new(path: &Path, text: &'x str) -> Result<Self, FileError> {
        let document = Document::parse(text).map_err(|error| FileError {
            path: path.to_owned(),
            place: Some((error.pos().row as usize, error.pos().col as usize)),
            message: format!("this is not valid XML: {error}"),
        })?;
        Ok(Self {
            path: path.to_owned(),
            document,
            notes: RefCell::default(),
        })
    }

    /// Note something about an element that is not an error.
    pub fn note(&self, node: Node<'_, '_>, message: impl fmt::Display) {
        let place = self.document.text_pos_at(node.range().start);
        self.notes
            .borrow_mut()
            .push((place.row, message.to_string()));
    }

    /// All notes, in the order of the file.
    pub fn into_notes(self) -> Vec<String> {
        let mut notes = self.notes.into_inner();
        notes.sort();
        notes.dedup();
        notes
            .into_iter()
            .map(|(line, note)| format!("line {line}: {note}"))
            .collect()
    }

    /// The root element, which must have this name.
    pub fn root(&self, name: &str) -> Result<Node<'_, 'x>, FileError> {
        let root = self.document.root_element();
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
        FileError {
            path: self.path.clone(),
            place: Some((place.row as usize, place.col as usize)),
            message: message.into(),
        }
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

    /// The numbers of an attribute, if given.
    pub fn list(&self, node: Node<'_, '_>, key: &str) -> Result<Option<Vec<f64>>, FileError> {
        let Some(text) = node.attribute(key) else {
            return Ok(None);
        };
        let number = |word: &str| match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => {
                let remedy = if word.contains('$') {
                    "; expand the file with `xacro` first"
                } else {
                    ""
                };
                let message = format!("`{key}`: \"{word}\" is not a number{remedy}");
                Err(self.attribute_error(node, key, message))
            }
        };
        text.split_whitespace()
            .map(number)
            .collect::<Result<_, _>>()
            .map(Some)
    }

    /// Exactly `N` numbers of an attribute, if given.
    pub fn numbers<const N: usize>(
        &self,
        node: Node<'_, '_>,
        key: &str,
    ) -> Result<Option<[f64; N]>, FileError> {
        let Some(list) = self.list(node, key)? else {
            return Ok(None);
        };
        list.try_into().map(Some).map_err(|list: Vec<f64>| {
            let message = format!("`{key}` takes {N} numbers, found {}", list.len());
            self.attribute_error(node, key, message)
        })
    }

    /// Angles (rad) of an attribute, if given. A usual fraction of a turn to many digits is taken as exact. One rounded to
    /// few digits is taken as written, with a note, since it fills the equations with small terms.
    pub fn angles<const N: usize>(
        &self,
        node: Node<'_, '_>,
        key: &str,
    ) -> Result<Option<[f64; N]>, FileError> {
        let Some(mut angles) = self.numbers::<N>(node, key)? else {
            return Ok(None);
        };
        let words = node.attribute(key).unwrap_or_default().split_whitespace();
        for (angle, word) in angles.iter_mut().zip(words) {
            let meant = angle_meant(word, *angle);
            if (meant - *angle).abs() < ROUNDING {
                *angle = meant;
            } else {
                self.note(
                    node,
                    format!("`{key}`: {word} is taken as written; if {meant} is meant, that makes shorter equations"),
                );
            }
        }
        Ok(Some(angles))
    }

    /// One number, or `default`.
    pub fn number_or(&self, node: Node<'_, '_>, key: &str, default: f64) -> Result<f64, FileError> {
        let number = self.numbers::<1>(node, key)?;
        Ok(number.map_or(default, |[number]| number))
    }

    /// One number, which must be given.
    pub fn required(&self, node: Node<'_, '_>, key: &str) -> Result<f64, FileError> {
        let number = self.numbers::<1>(node, key)?;
        number.map(|[number]| number).ok_or_else(|| {
            let message = format!("`{key}` is missing in <{}>", node.tag_name().name());
            self.error(node, message)
        })
    }

    /// One number that is not negative, or zero.
    pub fn not_negative(&self, node: Node<'_, '_>, key: &str) -> Result<f64, FileError> {
        let number = self.number_or(node, key, 0.0)?;
        if number < 0.0 {
            let message = format!("`{key}` is {number}; give zero or a positive number");
            return Err(self.attribute_error(node, key, message));
        }
        Ok(number)
    }

    /// A vector, or zero.
    pub fn vector(&self, node: Node<'_, '_>, key: &str) -> Result<Vector3<f64>, FileError> {
        let numbers = self.numbers::<3>(node, key)?;
        Ok(numbers.map_or(Vector3::zeros(), Vector3::from))
    }

    /// A unit vector, or `default`.
    pub fn direction(
        &self,
        node: Node<'_, '_>,
        key: &str,
        default: Vector3<f64>,
    ) -> Result<Vector3<f64>, FileError> {
        let given = self.numbers::<3>(node, key)?.map_or(default, Vector3::from);
        if given.norm() < 1e-10 {
            let message = format!("`{key}` is a direction and has no length");
            return Err(self.attribute_error(node, key, message));
        }
        Ok(given.normalize())
    }

    /// A name, which must be given.
    pub fn name<'a>(&self, node: Node<'a, '_>, key: &str) -> Result<&'a str, FileError> {
        node.attribute(key).ok_or_else(|| {
            let message = format!("`{key}` is missing in <{}>", node.tag_name().name());
            self.error(node, message)
        })
    }
}

/// The child elements.
pub(in crate::formats) fn elements<'a, 'x>(
    node: Node<'a, 'x>,
) -> impl Iterator<Item = Node<'a, 'x>> {
    node.children().filter(Node::is_element)
}

/// The child elements of one name.
pub(in crate::formats) fn named<'a, 'x>(
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

/// A difference (rad) without influence on the equations.
const ROUNDING: f64 = 1e-10;

/// The fraction of a turn that an angle is rounded from, such as a quarter turn for `1.5708`; else the angle itself.
pub(in crate::formats) fn angle_meant(word: &str, value: f64) -> f64 {
    let digits = word.split_once('.').map_or(0, |(_, digits)| digits.len());
    let fraction = match digits {
        0 | 1 => return value,
        2 | 3 => PI / 2.0,
        _ => PI / 12.0,
    };
    let near = (value / fraction).round() * fraction;
    let unit = 10f64.powi(-i32::try_from(digits).unwrap_or(i32::MAX));
    // Rounded or truncated; never to zero.
    let lost = (near.abs() - value.abs()) / unit;
    if near != 0.0 && (-0.5..1.0).contains(&lost) {
        near
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

    use super::angle_meant;

    #[test]
    fn rounded_fractions_of_a_turn_are_meant() {
        for (word, meant) in [
            ("1.57", FRAC_PI_2),
            ("-1.5708", -FRAC_PI_2),
            ("3.14159", PI),
            ("1.5707", FRAC_PI_2),
            ("0.7854", FRAC_PI_4),
            ("1.5707963267948966", FRAC_PI_2),
        ] {
            assert_eq!(angle_meant(word, word.parse().unwrap()), meant, "{word}");
        }
        for word in ["1.6", "1.58", "0.79", "0.7860", "1.5700", "0", "0.3"] {
            let value: f64 = word.parse().unwrap();
            assert_eq!(angle_meant(word, value), value, "{word}");
        }
        assert_eq!(angle_meant("0.00", 0.0), 0.0);
    }
}
