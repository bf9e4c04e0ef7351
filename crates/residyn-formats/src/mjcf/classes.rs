//! Default classes, which supply attributes that elements lack.

use std::collections::HashMap;

use roxmltree::Node;

use crate::robot::element::Element;
use crate::xml::{Source, elements, named};
use residyn_core::limits::XML_DEFAULTS;
use residyn_core::model::FileError;

/// The default classes of a file.
pub(super) struct Classes<'s, 'x> {
    source: &'s Source<'x>,
    /// For each class, its `<default>` and the enclosing ones, innermost first.
    classes: HashMap<&'s str, Vec<Node<'s, 'x>>>,
    outermost: &'s str,
}

impl<'s, 'x> Classes<'s, 'x> {
    /// # Errors
    /// A class with more elements than are searched for each element.
    pub fn new(source: &'s Source<'x>, root: Node<'s, 'x>) -> Result<Self, FileError> {
        let mut new = Self {
            source,
            classes: HashMap::new(),
            outermost: "main",
        };
        // Several top-level defaults form one class, in which later ones prevail.
        let mut top: Vec<Node<'s, 'x>> = named(root, "default").collect();
        top.reverse();
        if let Some(name) = top.iter().find_map(|node| node.attribute("class")) {
            new.outermost = name;
        }
        for node in &top {
            new.add_below(*node, &top)?;
        }
        new.add(new.outermost, top)?;
        Ok(new)
    }

    fn add_below(&mut self, node: Node<'s, 'x>, behind: &[Node<'s, 'x>]) -> Result<(), FileError> {
        for inner in named(node, "default") {
            let all = [&[inner], behind].concat();
            self.add_below(inner, &all)?;
            self.add(inner.attribute("class").unwrap_or_default(), all)?;
        }
        Ok(())
    }

    fn add(&mut self, name: &'s str, defaults: Vec<Node<'s, 'x>>) -> Result<(), FileError> {
        let all = || defaults.iter().flat_map(|default| elements(*default));
        if let Some(node) = all().nth(XML_DEFAULTS) {
            let message = format!(
                "the default class `{name}` has more than {XML_DEFAULTS} elements, including those of the classes around it; give the attributes at the elements they apply to"
            );
            return Err(self.source.error(node, message));
        }
        self.classes.insert(name, defaults);
        Ok(())
    }

    /// The name of the class that applies if none is named.
    pub fn outermost(&self) -> &'s str {
        self.outermost
    }

    /// An element with its defaults, under any of `tags`; `class` applies if it names none itself.
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
        Ok(Element::new(self.source, nodes))
    }
}
