//! Elements and the numbers in their attributes.

use std::f64::consts::PI;
use std::fmt;

use nalgebra::Vector3;
use roxmltree::Node;

use crate::xml::{Source, named};
use residyn_core::limits::is_reading;
use residyn_core::model::FileError;

/// An element: its own attributes, then those of its defaults, if the format has defaults.
pub(crate) struct Element<'s, 'x> {
    source: &'s Source<'x>,
    /// The first node with an attribute prevails.
    nodes: Vec<Node<'s, 'x>>,
}

impl<'s, 'x> Element<'s, 'x> {
    /// The element of the first node; the others are its defaults.
    pub fn new(source: &'s Source<'x>, nodes: Vec<Node<'s, 'x>>) -> Self {
        Self { source, nodes }
    }

    /// All elements with this name below the root, as one; later ones prevail.
    pub fn of_section(source: &'s Source<'x>, root: Node<'s, 'x>, name: &'static str) -> Self {
        let mut nodes: Vec<Node<'s, 'x>> = named(root, name).collect();
        nodes.reverse();
        // Messages point at the root if the section is missing.
        nodes.push(root);
        Self { source, nodes }
    }

    /// The element that gives an attribute: itself or one of its defaults; itself if none does.
    fn node(&self, key: &str) -> Node<'s, 'x> {
        let mut nodes = self.nodes.iter().copied();
        nodes
            .find(|node| node.has_attribute(key))
            .unwrap_or(self.nodes[0])
    }

    /// The element and its defaults one by one, in order of precedence.
    pub fn parts(&self) -> impl Iterator<Item = Self> {
        self.nodes.iter().map(|node| self.source.element(*node))
    }

    /// Position in the file, bytes.
    pub fn at(&self) -> usize {
        self.nodes[0].range().start
    }

    pub fn text(&self, key: &str) -> Option<&'s str> {
        self.node(key).attribute(key)
    }

    /// A text that must be given.
    pub fn required_text(&self, key: &str) -> Result<&'s str, FileError> {
        self.text(key).ok_or_else(|| self.missing(key))
    }

    /// The numbers of an attribute, if given.
    pub fn list(&self, key: &str) -> Result<Option<Vec<f64>>, FileError> {
        let Some(text) = self.text(key) else {
            return Ok(None);
        };
        let number = |word: &str| match word.parse::<f64>() {
            Ok(number) if is_reading(number) => Ok(number),
            _ => {
                let remedy = if word.contains('$') {
                    "; expand the file with `xacro` first"
                } else {
                    ""
                };
                let message = format!("`{key}`: \"{word}\" is not a number{remedy}");
                Err(self.attribute_error(key, message))
            }
        };
        let numbers: Result<_, _> = text.split_whitespace().map(number).collect();
        numbers.map(Some)
    }

    /// Exactly `N` numbers of an attribute, if given.
    pub fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, FileError> {
        let Some(list) = self.list(key)? else {
            return Ok(None);
        };
        list.try_into().map(Some).map_err(|list: Vec<f64>| {
            let message = format!("`{key}` takes {N} numbers, found {}", list.len());
            self.attribute_error(key, message)
        })
    }

    /// Angles (rad) of an attribute, if given. A common fraction of a turn with many digits is taken as exact. A
    /// fraction rounded to few digits is taken as written, with a note, since it fills the equations with small terms.
    pub fn angles<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, FileError> {
        let Some(mut angles) = self.numbers::<N>(key)? else {
            return Ok(None);
        };
        let words = self.text(key).unwrap_or_default().split_whitespace();
        for (angle, word) in angles.iter_mut().zip(words) {
            let meant = angle_meant(word, *angle);
            if (meant - *angle).abs() < ROUNDING {
                *angle = meant;
            } else {
                let message = format!(
                    "`{key}`: {word} is taken as written; if {meant} is meant, writing it so makes shorter equations"
                );
                self.source.note(self.node(key), message);
            }
        }
        Ok(Some(angles))
    }

    /// One number, or `default`.
    pub fn number_or(&self, key: &str, default: f64) -> Result<f64, FileError> {
        Ok(self.numbers(key)?.map_or(default, |[number]| number))
    }

    /// One number, which must be given.
    pub fn required(&self, key: &str) -> Result<f64, FileError> {
        let number = self.numbers(key)?;
        number
            .map(|[number]| number)
            .ok_or_else(|| self.missing(key))
    }

    /// One number that is not negative, or zero.
    pub fn not_negative(&self, key: &str) -> Result<f64, FileError> {
        let number = self.number_or(key, 0.0)?;
        if number < 0.0 {
            let message = format!("`{key}` is {number}; give zero or a positive number");
            return Err(self.attribute_error(key, message));
        }
        Ok(number)
    }

    /// A vector, or zero.
    pub fn vector(&self, key: &str) -> Result<Vector3<f64>, FileError> {
        let numbers = self.numbers::<3>(key)?;
        Ok(numbers.map_or(Vector3::zeros(), Vector3::from))
    }

    /// A unit vector, or `default`.
    pub fn direction(&self, key: &str, default: Vector3<f64>) -> Result<Vector3<f64>, FileError> {
        let given = self.numbers::<3>(key)?.map_or(default, Vector3::from);
        if given.norm() < 1e-10 {
            let message = format!("`{key}` is a direction but has zero length");
            return Err(self.attribute_error(key, message));
        }
        Ok(given.normalize())
    }

    /// A range in force: `switch` enables it, or the switch is automatic and the range is given.
    pub fn limits(
        &self,
        range: &str,
        switch: &str,
        autolimits: bool,
    ) -> Result<Option<[f64; 2]>, FileError> {
        let holds = match self.text(switch) {
            Some("true") => true,
            Some("false") => false,
            _ => autolimits,
        };
        let given = self.numbers::<2>(range)?;
        Ok(given.filter(|[low, high]| holds && low < high))
    }

    pub fn error(&self, message: impl Into<String>) -> FileError {
        self.source.error(self.nodes[0], message)
    }

    fn missing(&self, key: &str) -> FileError {
        let node = self.node(key);
        let message = format!("`{key}` is missing in <{}>", node.tag_name().name());
        self.source.error(node, message)
    }

    pub fn attribute_error(&self, key: &str, message: impl Into<String>) -> FileError {
        self.source.attribute_error(self.node(key), key, message)
    }

    pub fn note(&self, message: impl fmt::Display) {
        self.source.note(self.nodes[0], message);
    }

    /// Refuse an attribute that is given and not zero.
    pub fn refuse(&self, key: &str, remedy: &str) -> Result<(), FileError> {
        match self.text(key) {
            None | Some("0") => Ok(()),
            Some(value) => {
                Err(self.attribute_error(key, format!("`{key}=\"{value}\"` is not read; {remedy}")))
            }
        }
    }

    /// Note attributes other than the known ones, whose names are separated by blanks.
    pub fn note_others(&self, known: &str) {
        let is_known = |name: &str| known.split(' ').any(|known| known == name);
        let given = self
            .nodes
            .iter()
            .filter(|node| !node.has_tag_name("mujoco"));
        for (node, attribute) in given.flat_map(|node| node.attributes().map(move |a| (node, a))) {
            if !is_known(attribute.name()) {
                let message = format!(
                    "`{}` of <{}> is not carried",
                    attribute.name(),
                    node.tag_name().name()
                );
                self.source.note(*node, message);
            }
        }
    }
}

/// A difference (rad) that does not affect the equations.
const ROUNDING: f64 = 1e-10;

/// The fraction of a turn that was rounded to this angle, such as a quarter turn for `1.5708`; else the angle itself.
fn angle_meant(word: &str, value: f64) -> f64 {
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
    fn rounded_fractions_of_a_turn_are_recognised() {
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
