//! Refuses XML with too many elements or names for the parser, which searches all of them at each one.

use std::path::Path;

use residyn_core::limits::{XML_ATTRIBUTES, XML_DEPTH};
use residyn_core::model::FileError;

/// Refuses a text in which an element has too many attributes, too many namespaces have names, or elements are nested
/// too deeply: before it is parsed, and whether or not it is XML.
///
/// # Errors
/// The place of the excess.
pub(super) fn check(path: &Path, text: &str) -> Result<(), FileError> {
    let crowded = |at: usize, message: String| {
        let before = &text[..at];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        FileError::new(path, Some((line, column)), message)
    };
    let (mut at, mut depth, mut namespaces) = (0, 0_usize, 0);
    while let Some(next) = text[at..].find('<') {
        let start = at + next;
        let tag = Tag::of(&text[start..]);
        at = start + tag.length;
        depth = (depth + tag.opens).saturating_sub(tag.closes);
        namespaces += tag.namespaces;
        if depth > XML_DEPTH {
            let message = format!("is nested in more than {XML_DEPTH} elements; flatten the file");
            return Err(crowded(start, message));
        }
        if tag.attributes.max(namespaces) > XML_ATTRIBUTES {
            let message = format!(
                "more than {XML_ATTRIBUTES} attributes in an element, or namespace names; remove those that nothing reads"
            );
            return Err(crowded(start, message));
        }
    }
    Ok(())
}

/// Markup that begins with `<`, to its end.
#[derive(Default)]
struct Tag {
    /// Bytes.
    length: usize,
    opens: usize,
    closes: usize,
    attributes: usize,
    namespaces: usize,
}

impl Tag {
    fn of(text: &str) -> Self {
        for (begin, end) in [
            ("<!--", "-->"),
            ("<![CDATA[", "]]>"),
            ("<?", "?>"),
            ("</", ">"),
        ] {
            if text.starts_with(begin) {
                let length = text.find(end).map_or(text.len(), |found| found + end.len());
                return Self {
                    length,
                    closes: usize::from(begin == "</"),
                    ..Self::default()
                };
            }
        }
        Self::opening(text)
    }

    fn opening(text: &str) -> Self {
        let mut tag = Self {
            opens: 1,
            ..Self::default()
        };
        loop {
            let rest = &text[tag.length..];
            let Some(found) = rest[1..].find(['"', '\'', '>', '<']).map(|found| found + 1) else {
                tag.length = text.len();
                return tag;
            };
            tag.length += found;
            match rest.as_bytes()[found] {
                b'<' => return tag,
                b'>' => {
                    tag.closes = usize::from(rest[..found].ends_with('/'));
                    tag.length += 1;
                    return tag;
                }
                quote => {
                    tag.attributes += 1;
                    tag.namespaces += usize::from(rest[..found].contains("xmlns"));
                    let value = &text[tag.length + 1..];
                    let Some(end) = value.find(char::from(quote)) else {
                        tag.length = text.len();
                        return tag;
                    };
                    tag.length += 1 + end;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::check;

    fn message(text: &str) -> Option<String> {
        check("a.xml".as_ref(), text)
            .err()
            .map(|error| error.to_string())
    }

    #[test]
    fn what_a_parser_would_look_through_again_and_again_is_refused() {
        let many = |part: &dyn Fn(usize) -> String| (0..201).map(part).collect::<String>();
        let attributes = many(&|k| format!(" b{k}='>\n<a \"'"));
        let crowded = format!("<r>\n<!-- {attributes} -->\n <a{attributes}/></r>");
        assert!(
            message(&crowded)
                .unwrap()
                .starts_with("a.xml, line 204, column 2: more than 200")
        );
        let namespaces = many(&|k| format!("<a xmlns:b{k}='c'/>"));
        assert!(message(&namespaces).unwrap().contains("namespace names"));
        let deep = "<a b='/>'>".repeat(201);
        assert!(
            message(&deep)
                .unwrap()
                .contains("in more than 200 elements")
        );
        let flat = "<a><b/><![CDATA[<a>]]></a>".repeat(201);
        for sound in [
            &flat,
            "",
            "<",
            "<a b='\u{e9}",
            "<\u{e9}",
            "<a b=\u{e9}'x'>",
            "</",
            "<!--",
        ] {
            assert_eq!(message(sound), None, "{sound}");
        }
    }
}
