//! Edits to an XML file that leave the rest of it unchanged.

use std::ops::Range;

use roxmltree::Node;

use super::mechanism::numbers;

/// A file with changes at places in its text.
pub(crate) struct Edit<'x> {
    text: &'x str,
    changes: Vec<(Range<usize>, String)>,
}

impl<'x> Edit<'x> {
    pub fn of(text: &'x str) -> Self {
        Self {
            text,
            changes: Vec::new(),
        }
    }

    /// Give an attribute these numbers, unless it already has them.
    pub fn set(&mut self, node: Node<'_, '_>, key: &str, values: &[f64]) {
        let new = numbers(values);
        match node.attribute_node(key) {
            Some(given) if holds(given.value(), values) => {}
            Some(given) => self.changes.push((given.range_value(), new)),
            None => self.put(self.head_end(node), format!(" {key}=\"{new}\"")),
        }
    }

    /// Remove an attribute and the blanks before it.
    pub fn remove(&mut self, node: Node<'_, '_>, key: &str) {
        if let Some(given) = node.attribute_node(key) {
            let start = self.text[..given.range().start].trim_end().len();
            self.changes.push((start..given.range().end, String::new()));
        }
    }

    /// Insert an element before the others in `node`, on its own line if the others have theirs.
    pub fn insert(&mut self, node: Node<'_, '_>, element: &str) {
        let own = &self.text[node.range()];
        if let Some(first) = node.first_element_child() {
            let at = first.range().start;
            let blanks = &self.text[self.text[..at].trim_end_matches([' ', '\t']).len()..at];
            let line = &self.text[self.text[..at].trim_end().len()..at];
            let after = if line.contains('\n') {
                format!("\n{blanks}")
            } else {
                String::new()
            };
            self.put(at, format!("{element}{after}"));
        } else if own.ends_with("/>") {
            let end = node.range().end;
            let closed = format!(">{element}</{}>", self.name(node));
            self.changes.push((end - 2..end, closed));
        } else {
            let close = own.rfind("</").unwrap_or(own.len());
            self.put(node.range().start + close, element.to_owned());
        }
    }

    /// The text with all changes.
    pub fn finished(mut self) -> String {
        self.changes.sort_by_key(|(range, _)| range.start);
        let (mut out, mut at) = (String::new(), 0);
        for (range, new) in &self.changes {
            out += &self.text[at..range.start];
            out += new;
            at = range.end;
        }
        out + &self.text[at..]
    }

    fn put(&mut self, at: usize, new: String) {
        self.changes.push((at..at, new));
    }

    /// The name of an element, as the file writes it.
    fn name(&self, node: Node<'_, '_>) -> &'x str {
        let tag = &self.text[node.range().start + 1..];
        let end = tag.find(|c: char| c.is_whitespace() || "/>".contains(c));
        &tag[..end.unwrap_or(tag.len())]
    }

    /// The end of an element's last attribute, or of its name.
    fn head_end(&self, node: Node<'_, '_>) -> usize {
        let name = node.range().start + 1 + self.name(node).len();
        let ends = node.attributes().map(|given| given.range().end);
        ends.fold(name, usize::max)
    }
}

/// Whether a text holds these numbers, up to rounding.
fn holds(text: &str, values: &[f64]) -> bool {
    let given: Vec<f64> = text
        .split_whitespace()
        .map_while(|word| word.parse().ok())
        .collect();
    given.len() == values.len() && given.iter().zip(values).all(|(a, b)| same(*a, *b))
}

/// Whether two numbers are equal up to rounding.
pub(crate) fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-15 + 1e-12 * a.abs().max(b.abs())
}

#[cfg(test)]
mod tests {
    use roxmltree::Document;

    use super::Edit;

    const FILE: &str =
        "<a>\n  <!-- kept -->\n  <b  x='1'   y=\"2 3\"/>\n  <c></c><d>\n\t<e/>\n  </d>\n</a>\n";

    #[test]
    fn changes_touch_nothing_else() {
        let document = Document::parse(FILE).unwrap();
        let node = |name| {
            document
                .descendants()
                .find(|node| node.has_tag_name(name))
                .unwrap()
        };
        let mut edit = Edit::of(FILE);
        edit.set(node("b"), "y", &[2.0, 3.0]);
        assert_eq!(edit.finished(), FILE);
        let mut edit = Edit::of(FILE);
        edit.insert(node("d"), "<f/>");
        edit.set(node("b"), "y", &[2.0, 4.5]);
        edit.set(node("b"), "z", &[0.1]);
        edit.remove(node("b"), "x");
        edit.insert(node("c"), "<f/>");
        edit.insert(node("e"), "<f/>");
        let expected = "<a>\n  <!-- kept -->\n  <b   y=\"2 4.5\" z=\"0.1\"/>\n  <c><f/></c><d>\n\t<f/>\n\t<e><f/></e>\n  </d>\n</a>\n";
        assert_eq!(edit.finished(), expected);
    }
}
