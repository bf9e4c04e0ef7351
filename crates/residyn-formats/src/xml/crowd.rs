//! Refuses XML with too many attributes or namespaces for the parser, which searches all of them at each one.

use std::path::Path;

use residyn_core::limits::XML_ATTRIBUTES;
use residyn_core::model::FileError;

/// Refuses a text in which an element has too many attributes, or too many namespaces have names: before it is parsed,
/// and whether or not it is XML.
///
/// # Errors
/// The place of the excess.
pub(super) fn check(path: &Path, text: &str) -> Result<(), FileError> {
    let tag = |(at, _): &(usize, &str)| attributes(&text[at + 1..]) > XML_ATTRIBUTES;
    let crowded = text.match_indices('<').find(tag);
    let namespace = text.match_indices("xmlns").nth(XML_ATTRIBUTES);
    let message = format!(
        "more than {XML_ATTRIBUTES} attributes in an element, or namespace names; remove those that nothing reads"
    );
    match crowded.or(namespace) {
        None => Ok(()),
        Some((at, _)) => Err(FileError::at(path, text, at, message)),
    }
}

/// How many attributes a tag may have: quotes that follow an equals sign. It ends where the next one begins, since no
/// value contains `<`; comments have none.
fn attributes(tag: &str) -> usize {
    let tag = tag.split('<').next().unwrap_or_default();
    if tag.starts_with('!') {
        return 0;
    }
    let between_quotes = tag.split(['"', '\'']);
    between_quotes
        .filter(|name| name.trim_end().ends_with('='))
        .count()
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
        let attributes = many(&|k| format!(" b{k} =\n'/>\"'"));
        let crowded = format!("<r>\n<!-- {attributes} -->\n <a{attributes}/></r>");
        assert!(
            message(&crowded)
                .unwrap()
                .starts_with("a.xml, line 204, column 2: more than 200")
        );
        let namespaces = many(&|k| format!("<a xmlns:b{k}='c'/>"));
        assert!(message(&namespaces).unwrap().contains("namespace names"));
        let flat = "<a b='\"=\"'><b/><![CDATA[<a>]]></a>".repeat(201);
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
