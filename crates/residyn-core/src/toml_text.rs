//! TOML texts: limits on their size, and the check that their numbers are finite.

use serde::de::{DeserializeOwned, Error as _};
use toml::Spanned;
use toml::de::{DeTable, DeValue, Error};
use toml_parser::Source;
use toml_parser::lexer::TokenKind;

use crate::limits::{TOML_NESTING, TOML_PARTS};

/// Check that a TOML text does not have too many parts, or parts nested too deeply.
///
/// # Errors
/// Too many parts, or too deep: the place \[bytes\], and the limit.
pub fn check_size(text: &str) -> Result<(), (usize, String)> {
    // Separators of parts are counted wherever they occur.
    let parts = text.bytes().filter(|byte| b",=[{.\n".contains(byte));
    if parts.count() > TOML_PARTS {
        let message = format!(
            "it has more than {TOML_PARTS} values, keys, tables and lines; remove those that are not needed"
        );
        return Err((0, message));
    }
    let message = |at| {
        let message =
            format!("arrays and tables are nested more than {TOML_NESTING} deep; flatten them");
        (at, message)
    };
    too_deep(text).map(message).map_or(Ok(()), Err)
}

/// The start of the first array or table that is nested too deeply. The parser counts nesting too, but wrongly if
/// brackets do not match: here a bracket counts as open until its own end.
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

/// The line of a place \[bytes\], counted from 1.
pub(crate) fn line(text: &str, at: usize) -> usize {
    text[..at].matches('\n').count() + 1
}

/// The value that a TOML text describes.
///
/// # Errors
/// A text that is not TOML, has too many parts, does not describe a `T`, or contains a number that is not finite.
pub fn from_toml<T: DeserializeOwned>(text: &str) -> Result<T, Error> {
    let refused =
        |at: usize, message: &str| Error::custom(format!("line {}: {message}", line(text, at)));
    check_size(text).map_err(|(at, message)| refused(at, &message))?;
    let said = toml::from_str(text)?;
    let table = DeTable::parse(text)?;
    match table.get_ref().values().find_map(not_finite) {
        None => Ok(said),
        Some(number) => {
            let span = number.span();
            let message = format!("{} is not a finite number; write one", &text[span.clone()]);
            Err(refused(span.start, &message))
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
            let message = from_toml::<toml::Table>(&part.repeat(150_001)).unwrap_err();
            assert!(
                message.to_string().contains("more than 150000 values"),
                "{message}"
            );
        }
    }

    /// The brackets in the second miscount in the parser.
    #[test]
    fn deep_texts_are_refused_with_their_line() {
        let deep = |part: &str| format!("a = 1\nb = {}", part.repeat(5000));
        for part in ["[", "{[c]\nd={", "{a=[}],b=", "{a={]},b="] {
            let message = from_toml::<toml::Table>(&deep(part)).unwrap_err();
            assert!(
                message.to_string().contains("more than 80 deep"),
                "{message}"
            );
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
            let message = read(&format!("a = 1\n[b]\nc = [1.0, {{ d = {number} }}]"));
            let message = message.unwrap_err().to_string();
            let expected = format!("line 3: {number} is not a finite number; write one");
            assert_eq!(message.trim(), expected);
        }
    }
}
