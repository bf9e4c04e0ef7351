//! Texts in TOML: what is read of them at most, and that their numbers are finite.

use serde::de::{DeserializeOwned, Error as _};
use toml::Spanned;
use toml::de::{DeTable, DeValue, Error};
use toml_parser::Source;
use toml_parser::lexer::TokenKind;

use crate::limits::{TOML_NESTING, TOML_PARTS};

/// Whether a TOML text has no more parts than are read, and none too deep in others.
///
/// # Errors
/// Too many or too deep: where \[bytes\], and the limit.
pub fn check_size(text: &str) -> Result<(), (usize, String)> {
    // What separates parts is counted, wherever it stands.
    let parts = text.bytes().filter(|byte| b",=[{.\n".contains(byte));
    if parts.count() > TOML_PARTS {
        let told = format!(
            "it has more than {TOML_PARTS} values, keys, tables and lines; take out what is not needed"
        );
        return Err((0, told));
    }
    let told = |at| {
        let told = format!(
            "more than {TOML_NESTING} arrays and tables are within each other; take them apart"
        );
        (at, told)
    };
    too_deep(text).map(told).map_or(Ok(()), Err)
}

/// Where an array or table begins that is within too many others. The parser counts them, too, but not right where brackets
/// do not match: there one counts as open until its own end.
fn too_deep(text: &str) -> Option<usize> {
    let mut open = Vec::new();
    for token in Source::new(text).lex() {
        match token.kind() {
            TokenKind::LeftCurlyBracket => open.push(TokenKind::RightCurlyBracket),
            TokenKind::LeftSquareBracket => open.push(TokenKind::RightSquareBracket),
            kind if open.last() == Some(&kind) => drop(open.pop()),
            _ => {}
        }
        if open.len() > TOML_NESTING {
            return Some(token.span().start());
        }
    }
    None
}

/// The line of a place \[bytes\], from 1.
fn line(text: &str, at: usize) -> usize {
    text[..at].matches('\n').count() + 1
}

/// What a TOML text says.
///
/// # Errors
/// A text that is no TOML, has too many parts or does not say a `T`, and a number in it that is not finite.
pub fn from_toml<T: DeserializeOwned>(text: &str) -> Result<T, Error> {
    let refused = |at: usize, told: &str| Error::custom(format!("line {}: {told}", line(text, at)));
    check_size(text).map_err(|(at, told)| refused(at, &told))?;
    let said = toml::from_str(text)?;
    let table = DeTable::parse(text)?;
    match table.get_ref().values().find_map(not_finite) {
        None => Ok(said),
        Some(number) => {
            let span = number.span();
            let told = format!("{} is no finite number; write one", &text[span.clone()]);
            Err(refused(span.start, &told))
        }
    }
}

/// The first number that is not finite.
fn not_finite<'v, 't>(value: &'v Spanned<DeValue<'t>>) -> Option<&'v Spanned<DeValue<'t>>> {
    match value.get_ref() {
        DeValue::Float(number) => {
            let is_finite = |number: f64| number.is_finite();
            (!number.as_str().parse().is_ok_and(is_finite)).then_some(value)
        }
        DeValue::Array(values) => values.iter().find_map(not_finite),
        DeValue::Table(table) => table.values().find_map(not_finite),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::from_toml;

    #[test]
    fn a_text_of_very_many_parts_is_refused() {
        for part in [", 7", "\n", "[[a]]", "a.", "{a = "] {
            let told = from_toml::<toml::Table>(&part.repeat(150_001)).unwrap_err();
            assert!(
                told.to_string().contains("more than 150000 values"),
                "{told}"
            );
        }
    }

    /// The brackets in the second miscount in the parser.
    #[test]
    fn deep_texts_are_refused_with_their_line() {
        let deep = |part: &str| format!("a = 1\nb = {}", part.repeat(5000));
        for part in ["[", "{[c]\nd={", "{a=[}],b=", "{a={]},b="] {
            let told = from_toml::<toml::Table>(&deep(part)).unwrap_err();
            assert!(told.to_string().contains("more than 80 arrays"), "{told}");
        }
        let least = format!("b = {}1{}", "[".repeat(80), "]".repeat(80));
        assert!(from_toml::<toml::Table>(&least).is_ok());
        let texts = format!("b = ['{0}', \"{0}\"] # {0}", "[".repeat(100));
        assert!(from_toml::<toml::Table>(&texts).is_ok());
    }

    #[test]
    fn every_number_is_finite() {
        let read = from_toml::<toml::Table>;
        assert_eq!(read("a = 1_000.5").unwrap()["a"].as_float(), Some(1000.5));
        for number in ["nan", "-inf"] {
            let told = read(&format!("a = 1\n[b]\nc = [1.0, {{ d = {number} }}]"));
            let told = told.unwrap_err().to_string();
            let expected = format!("line 3: {number} is no finite number; write one");
            assert_eq!(told.trim(), expected);
        }
    }
}
