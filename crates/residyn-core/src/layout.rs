//! Text wrapped into lines for a terminal.

/// Where the text next to a label begins \[characters\].
pub(crate) const LABEL: usize = 9;

/// A label and, next to it, a text in lines of at most `width` characters together, each with a line break.
pub(crate) fn hanging(label: &str, text: &str, width: usize) -> String {
    let labels = std::iter::once(label).chain(std::iter::repeat(""));
    let lines = labels.zip(wrap(text, width - LABEL));
    lines
        .map(|(label, line)| format!("{label:<LABEL$}{line}\n"))
        .collect()
}

/// Breaks a text at spaces into lines of at most `width` characters.
pub fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().expect("there is a first line");
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(word.to_owned());
        } else {
            line.push_str(if line.is_empty() { "" } else { " " });
            line.push_str(word);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::{hanging, wrap};

    #[test]
    fn long_texts_are_broken_at_spaces() {
        assert_eq!(wrap("one two three", 7), ["one two", "three"]);
        assert_eq!(wrap("", 7), [""]);
        assert_eq!(
            hanging("info", "one two three", 16),
            "info     one two\n         three\n"
        );
    }
}
