//! Elements with their default classes.

use std::collections::HashMap;
use std::fmt;

use nalgebra::Vector3;
use roxmltree::Node;

use crate::formats::xml::{Source, elements, named};
use crate::model::FileError;

/// The default classes of a file.
pub(super) struct Classes<'s, 'x> {
    source: &'s Source<'x>,
    /// For each class its own `<default>` and the enclosing ones, innermost first.
    classes: HashMap<&'s str, Vec<Node<'s, 'x>>>,
    outermost: &'s str,
}

impl<'s, 'x> Classes<'s, 'x> {
    pub fn new(source: &'s Source<'x>, root: Node<'s, 'x>) -> Self {
        let mut new = Self {
            source,
            classes: HashMap::new(),
            outermost: "main",
        };
        // Several top-level ones are one class, in which later ones prevail.
        let mut top: Vec<Node<'s, 'x>> = named(root, "default").collect();
        top.reverse();
        if let Some(name) = top.iter().find_map(|node| node.attribute("class")) {
            new.outermost = name;
        }
        for node in &top {
            new.add_below(*node, &top);
        }
        new.classes.insert(new.outermost, top);
        new
    }

    fn add_below(&mut self, node: Node<'s, 'x>, behind: &[Node<'s, 'x>]) {
        for inner in named(node, "default") {
            let all = [&[inner], behind].concat();
            self.add_below(inner, &all);
            self.classes
                .insert(inner.attribute("class").unwrap_or_default(), all);
        }
    }

    /// The name of the class that applies where none is named.
    pub fn outermost(&self) -> &'s str {
        self.outermost
    }

    /// An element with its defaults, under any of `tags`; `class` applies where it names none itself.
    pub fn element(
        &self,
        node: Node<'s, 'x>,
        class: &str,
        tags: &[&str],
    ) -> Result<Element<'s, 'x>, FileError> {
        let class = node.attribute("class").unwrap_or(class);
        let Some(defaults) = self.classes.get(class) else {
            let message = format!("there is no default class `{class}`; correct the name");
            return Err(self.source.attribute_error(node, "class", message));
        };
        let mut nodes = vec![node];
        for default in defaults {
            let mut own: Vec<Node<'s, 'x>> = elements(*default)
                .filter(|inner| tags.contains(&inner.tag_name().name()))
                .collect();
            own.reverse();
            nodes.extend(own);
        }
        Ok(Element {
            source: self.source,
            nodes,
        })
    }
}

/// An element: its own attributes, then those of its defaults.
pub(super) struct Element<'s, 'x> {
    pub source: &'s Source<'x>,
    /// The first with an attribute prevails.
    nodes: Vec<Node<'s, 'x>>,
}

impl<'s, 'x> Element<'s, 'x> {
    /// An element without defaults.
    pub fn alone(source: &'s Source<'x>, node: Node<'s, 'x>) -> Self {
        Self {
            source,
            nodes: vec![node],
        }
    }

    /// All elements of a name below the root as one; later ones prevail.
    pub fn of_section(source: &'s Source<'x>, root: Node<'s, 'x>, name: &'static str) -> Self {
        let mut nodes: Vec<Node<'s, 'x>> = named(root, name).collect();
        nodes.reverse();
        // Messages point at the root where the section is missing.
        nodes.push(root);
        Self { source, nodes }
    }

    /// The element that gives an attribute: itself or one of its defaults; itself where none does.
    fn node(&self, key: &str) -> Node<'s, 'x> {
        let mut nodes = self.nodes.iter().copied();
        nodes
            .find(|node| node.has_attribute(key))
            .unwrap_or(self.nodes[0])
    }

    /// The element and its defaults one by one, in order of precedence.
    pub fn parts(&self) -> impl Iterator<Item = Self> {
        self.nodes
            .iter()
            .map(|node| Self::alone(self.source, *node))
    }

    pub fn at(&self) -> usize {
        self.nodes[0].range().start
    }

    pub fn text(&self, key: &str) -> Option<&'s str> {
        self.node(key).attribute(key)
    }

    pub fn list(&self, key: &str) -> Result<Vec<f64>, FileError> {
        Ok(self.source.list(self.node(key), key)?.unwrap_or_default())
    }

    pub fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, FileError> {
        self.source.numbers(self.node(key), key)
    }

    /// Angles in rad; see [`Source::angles`].
    pub fn angles<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, FileError> {
        self.source.angles(self.node(key), key)
    }

    pub fn number_or(&self, key: &str, default: f64) -> Result<f64, FileError> {
        self.source.number_or(self.node(key), key, default)
    }

    pub fn required(&self, key: &str) -> Result<f64, FileError> {
        self.source.required(self.node(key), key)
    }

    pub fn not_negative(&self, key: &str) -> Result<f64, FileError> {
        self.source.not_negative(self.node(key), key)
    }

    pub fn vector(&self, key: &str) -> Result<Vector3<f64>, FileError> {
        self.source.vector(self.node(key), key)
    }

    pub fn direction(&self, key: &str, default: Vector3<f64>) -> Result<Vector3<f64>, FileError> {
        self.source.direction(self.node(key), key, default)
    }

    /// A range in force: `switch` says so, or, where it is automatic, the range is given.
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

    /// Note attributes other than the known ones.
    pub fn note_others(&self, known: &[&str]) {
        let given = self
            .nodes
            .iter()
            .filter(|node| !node.has_tag_name("mujoco"));
        for (node, attribute) in given.flat_map(|node| node.attributes().map(move |a| (node, a))) {
            if !known.contains(&attribute.name()) {
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
