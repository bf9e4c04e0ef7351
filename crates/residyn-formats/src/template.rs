//! Text templates with placeholders, marked `@LIKE_THIS@`.

use std::fmt::{Display, Write};

/// A template with its places filled by the named values. The filled-in text is not searched for places.
pub(super) fn filled(template: &str, values: &[(&str, &dyn Display)]) -> String {
    let mut pieces = template.split('@');
    let mut text = pieces.next().unwrap_or_default().to_owned();
    while let Some(name) = pieces.next() {
        let known = values.iter().find(|(known, _)| *known == name);
        let _ = match known {
            Some((_, value)) => {
                write!(text, "{value}{}", pieces.next().unwrap_or_default())
            }
            None => write!(text, "@{name}"),
        };
    }
    text
}

#[cfg(test)]
mod tests {
    use super::filled;

    #[test]
    fn only_known_names_are_places() {
        let values: [(&str, &dyn std::fmt::Display); 2] = [("A", &1.5), ("B", &"@A@")];
        assert_eq!(filled("@A@, @B@ at a@b.c", &values), "1.5, @A@ at a@b.c");
    }
}
