use serde::de::{DeserializeOwned, Error as _};
use toml::Spanned;
use toml::de::{DeTable, DeValue, Error};

use crate::limits::TOML_PARTS;

/// Whether a TOML text has no more parts than are read: what separates them is counted, wherever it stands.
///
/// # Errors
/// Too many, and the limit.
pub fn check_parts(text: &str) -> Result<(), String> {
    let parts = text.bytes().filter(|byte| b",=[{.\n".contains(byte));
    match parts.count() <= TOML_PARTS {
        true => Ok(()),
        false => Err(format!(
            "it has more than {TOML_PARTS} values, keys, tables and lines; take out what is not needed"
        )),
    }
}

/// What a TOML text says.
///
/// # Errors
/// A text that is no TOML, has too many parts or does not say a `T`, and a number in it that is not finite.
pub fn from_toml<T: DeserializeOwned>(text: &str) -> Result<T, Error> {
    check_parts(text).map_err(Error::custom)?;
    let said = toml::from_str(text)?;
    let table = DeTable::parse(text)?;
    match table.get_ref().values().find_map(not_finite) {
        None => Ok(said),
        Some(number) => {
            let line = text[..number.span().start].matches('\n').count() + 1;
            let number = &text[number.span()];
            let told = format!("line {line}: {number} is no finite number; write one");
            Err(Error::custom(told))
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
