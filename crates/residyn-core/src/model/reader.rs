//! Reads hand-written TOML. Errors name file, line and column; for an unknown key they suggest a similar known one.

use std::cell::Cell;
use std::fmt;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::expr::{Formula, FormulaError, parse_finite, suggestion};
use crate::limits::{MODEL_NAMES, MODEL_TERMS};
use crate::toml_text::check_size;

/// An error in a model or effect file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileError {
    pub path: PathBuf,
    /// Line and column, counted from 1; `None` if the error concerns the whole file.
    pub place: Option<(usize, usize)>,
    pub message: String,
    /// What the caller can give instead to fix it.
    pub remedy: Option<FileRemedy>,
}

/// What fixes an error in a file, other than a change to the file itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileRemedy {
    /// Another last body of the chain that is read from a robot description.
    Tip,
}

impl FileError {
    pub fn new(path: &Path, place: Option<(usize, usize)>, message: impl Into<String>) -> Self {
        Self {
            path: path.to_owned(),
            place,
            message: message.into(),
            remedy: None,
        }
    }

    /// An error at a place in the text of a file \[bytes\].
    pub fn at(path: &Path, text: &str, at: usize, message: impl Into<String>) -> Self {
        let before = &text[..text.floor_char_boundary(at)];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        Self::new(path, Some((line, column)), message)
    }

    /// The same error, with this as a further remedy.
    #[must_use]
    pub fn remedied_by(self, remedy: FileRemedy) -> Self {
        Self {
            remedy: Some(remedy),
            ..self
        }
    }
}

impl std::error::Error for FileError {}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path.display())?;
        if let Some((line, column)) = self.place {
            write!(f, ", line {line}, column {column}")?;
        }
        write!(f, ": {}", self.message)
    }
}

/// A bare name, or a table that says more about what it names.
pub(super) enum NameOrTable<'a> {
    Name(Located<String>),
    Table(Section<'a>),
}

/// A file's text and name.
pub(super) struct Document {
    pub path: PathBuf,
    pub text: String,
    /// Number of terms in the formulas read so far.
    terms: Cell<usize>,
}

/// A value and its position in the text, in bytes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Located<T> {
    pub value: T,
    pub at: usize,
}

impl Document {
    pub fn new(path: &Path, text: &str) -> Self {
        Self {
            path: path.to_owned(),
            text: text.to_owned(),
            terms: Cell::new(0),
        }
    }

    pub fn parse(&self) -> Result<Section<'_>, FileError> {
        check_size(&self.text).map_err(|(at, message)| self.error(at, message))?;
        let table = DeTable::parse(&self.text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start);
            self.error(at, error.message())
        })?;
        Ok(Section {
            document: self,
            name: String::new(),
            at: 0,
            table: table.into_inner(),
        })
    }

    pub fn error(&self, at: usize, message: impl Into<String>) -> FileError {
        FileError::at(&self.path, &self.text, at, message)
    }

    pub fn formula_error(&self, at: usize, error: &FormulaError) -> FileError {
        self.error(at, error.to_string())
    }

    pub fn formula(&self, text: &Located<String>) -> Result<Located<Formula>, FileError> {
        let value =
            parse_finite(&text.value).map_err(|error| self.formula_error(text.at, &error))?;
        self.terms.update(|terms| terms + value.terms());
        if self.terms.get() > MODEL_TERMS {
            let message = format!(
                "the formulas up to here have more than {MODEL_TERMS} numbers, names and operations; describe a large \
                 mechanism under [chain]"
            );
            return Err(self.error(text.at, message));
        }
        Ok(Located { value, at: text.at })
    }
}

/// 2^53: above it, floating point skips whole numbers.
const MOST_WHOLE: f64 = 9_007_199_254_740_992.0;

type Value<'a> = Spanned<DeValue<'a>>;

/// One table of the file.
pub(super) struct Section<'a> {
    document: &'a Document,
    /// As in the header, empty for the top level.
    pub name: String,
    pub at: usize,
    table: DeTable<'a>,
}

impl<'a> Section<'a> {
    /// The table `key`, if present.
    pub fn section(&self, key: &str) -> Result<Option<Section<'a>>, FileError> {
        self.optional(key, Self::table_of)
    }

    /// The table `key`.
    pub fn required_section(&self, key: &str) -> Result<Section<'a>, FileError> {
        self.section(key)?
            .ok_or_else(|| self.error(format!("the table [{key}] is missing")))
    }

    /// The array of tables `key`, empty if absent.
    pub fn sections(&self, key: &str) -> Result<Vec<Section<'a>>, FileError> {
        let tables = self.list(key, "tables, written [[..]]", Self::table_of)?;
        Ok(tables.unwrap_or_default())
    }

    /// Every key, in the order of the file.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.table.keys().map(|key| key.get_ref().as_ref())
    }

    /// Every key with the byte offset of its value.
    pub fn places(&self) -> impl Iterator<Item = (&str, usize)> {
        let entries = self.table.iter();
        entries.map(|(key, value)| (key.get_ref().as_ref(), value.span().start))
    }

    /// Every key with its table, in the order of the file.
    pub fn named_sections(&self) -> Result<Vec<(String, Section<'a>)>, FileError> {
        self.entries(Self::table_of)
    }

    /// Every key with its text, in the order of the file.
    pub fn named_texts(&self) -> Result<Vec<(String, Located<String>)>, FileError> {
        self.entries(Self::text_of)
    }

    pub fn text(&self, key: &str) -> Result<Option<Located<String>>, FileError> {
        self.optional(key, Self::text_of)
    }

    pub fn required_text(&self, key: &str) -> Result<Located<String>, FileError> {
        self.text(key)?.ok_or_else(|| self.missing(key))
    }

    /// A text that may be left out, in which case it is empty.
    pub fn text_or_empty(&self, key: &str) -> Result<String, FileError> {
        Ok(self.text(key)?.map_or_else(String::new, |text| text.value))
    }

    pub fn formula(&self, key: &str) -> Result<Option<Located<Formula>>, FileError> {
        let text = self.text(key)?;
        text.map(|text| self.document.formula(&text)).transpose()
    }

    pub fn number(&self, key: &str) -> Result<Option<f64>, FileError> {
        self.optional(key, Self::number_of)
    }

    pub fn required_number(&self, key: &str) -> Result<f64, FileError> {
        self.number(key)?.ok_or_else(|| self.missing(key))
    }

    pub fn whole(&self, key: &str) -> Result<Option<usize>, FileError> {
        let Some(number) = self.number(key)? else {
            return Ok(None);
        };
        if number.fract() != 0.0 || !(0.0..MOST_WHOLE).contains(&number) {
            return Err(self.error_at(
                key,
                format!("`{key}` must be a whole number, found {number}"),
            ));
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // just checked
        Ok(Some(number as usize))
    }

    /// False if absent.
    pub fn flag(&self, key: &str) -> Result<bool, FileError> {
        self.get(key).map_or(Ok(false), |value| {
            value
                .get_ref()
                .as_bool()
                .ok_or_else(|| self.wrong(value, key, "true or false"))
        })
    }

    pub fn numbers(&self, key: &str) -> Result<Option<Vec<f64>>, FileError> {
        self.list(key, "a list of numbers", Self::number_of)
    }

    /// Numbers that may be infinite.
    pub fn limits(&self, key: &str) -> Result<Option<Vec<f64>>, FileError> {
        self.list(key, "a list of numbers", Self::limit_of)
    }

    /// The admissible range that `positive` and `bounds` declare.
    pub fn bounds(&self) -> Result<[f64; 2], FileError> {
        let lowest = if self.flag("positive")? {
            0.0
        } else {
            f64::NEG_INFINITY
        };
        match self.limits("bounds")?.as_deref() {
            None => Ok([lowest, f64::INFINITY]),
            Some(&[low, high]) if low < high => Ok([low.max(lowest), high]),
            Some(_) => Err(self.error_at(
                "bounds",
                "`bounds` must be a list of two increasing numbers, such as [0, 2]",
            )),
        }
    }

    /// The value that stands for a text; an absent text is empty. `allowed` is for the message.
    pub fn choice<T: Copy>(
        &self,
        key: &str,
        allowed: &str,
        choices: &[(&str, T)],
    ) -> Result<T, FileError> {
        let text = self.text_or_empty(key)?;
        let chosen = choices.iter().find(|(name, _)| *name == text);
        chosen
            .map(|(_, value)| *value)
            .ok_or_else(|| self.error_at(key, format!("`{key}` must be {allowed}, found {text:?}")))
    }

    pub fn texts(&self, key: &str) -> Result<Option<Vec<Located<String>>>, FileError> {
        self.list(key, "a list of strings", Self::text_of)
    }

    pub fn name_or_table(&self, key: &str) -> Result<Option<NameOrTable<'a>>, FileError> {
        self.optional(key, Self::name_or_table_of)
    }

    pub fn names_or_tables(&self, key: &str) -> Result<Option<Vec<NameOrTable<'a>>>, FileError> {
        self.list(key, "a list of names or tables", Self::name_or_table_of)
    }

    pub fn is_empty_list(&self, key: &str) -> bool {
        let list = self.get(key).and_then(|value| value.get_ref().as_array());
        list.is_some_and(|list| list.is_empty())
    }

    /// A list of lists of texts.
    pub fn matrix(&self, key: &str) -> Result<Option<Vec<Vec<Located<String>>>>, FileError> {
        let rows = "a list of rows";
        self.list(key, rows, |section, key, row| {
            section.list_of(key, row, rows, Self::text_of)
        })
    }

    /// Refuse keys other than `known`.
    pub fn only(&self, known: &[&str]) -> Result<(), FileError> {
        let stranger = self
            .table
            .keys()
            .find(|key| !known.contains(&key.get_ref().as_ref()));
        stranger.map_or(Ok(()), |key| {
            let near = suggestion(key.get_ref(), known.iter().copied());
            let within = if self.name.is_empty() {
                String::new()
            } else {
                format!(" in [{}]", self.name)
            };
            let remedy = if near.is_empty() {
                format!("; known are {}", known.join(", "))
            } else {
                near
            };
            let message = format!("unknown key `{}`{within}{remedy}", key.get_ref());
            Err(self.document.error(key.span().start, message))
        })
    }

    /// An error at this table.
    pub fn error(&self, message: impl Into<String>) -> FileError {
        self.document.error(self.at, message)
    }

    /// An error at the value of `key`.
    pub fn error_at(&self, key: &str, message: impl Into<String>) -> FileError {
        let at = self.get(key).map_or(self.at, |value| value.span().start);
        self.document.error(at, message)
    }

    pub fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    /// Whether `key` holds a table (and not a plain value).
    pub fn is_table(&self, key: &str) -> bool {
        self.get(key)
            .is_some_and(|value| value.get_ref().is_table())
    }

    fn get(&self, key: &str) -> Option<&Value<'a>> {
        self.table
            .iter()
            .find(|(k, _)| k.get_ref() == key)
            .map(|(_, value)| value)
    }

    fn missing(&self, key: &str) -> FileError {
        self.error(format!("`{key}` is missing in [{}]", self.name))
    }

    fn wrong(&self, value: &Value<'a>, key: &str, wanted: &str) -> FileError {
        let found = value.get_ref().type_str();
        self.document.error(
            value.span().start,
            format!("`{key}` must be {wanted}, found {found}"),
        )
    }

    /// What `of` reads from the value of `key`, if present.
    fn optional<T>(
        &self,
        key: &str,
        of: impl Fn(&Self, &str, &Value<'a>) -> Result<T, FileError>,
    ) -> Result<Option<T>, FileError> {
        self.get(key).map(|value| of(self, key, value)).transpose()
    }

    /// What `of` reads from every value, in the order of the file.
    fn entries<T>(
        &self,
        of: impl Fn(&Self, &str, &Value<'a>) -> Result<T, FileError>,
    ) -> Result<Vec<(String, T)>, FileError> {
        let entries = self.table.iter();
        self.check_count(self.at, entries.len())?;
        entries
            .map(|(key, value)| Ok((key.get_ref().to_string(), of(self, key.get_ref(), value)?)))
            .collect()
    }

    /// What `of` reads from each item of the list `key`, if present.
    fn list<T>(
        &self,
        key: &str,
        wanted: &str,
        of: impl Fn(&Self, &str, &Value<'a>) -> Result<T, FileError>,
    ) -> Result<Option<Vec<T>>, FileError> {
        self.optional(key, |section, key, value| {
            section.list_of(key, value, wanted, &of)
        })
    }

    fn list_of<T>(
        &self,
        key: &str,
        value: &Value<'a>,
        wanted: &str,
        of: impl Fn(&Self, &str, &Value<'a>) -> Result<T, FileError>,
    ) -> Result<Vec<T>, FileError> {
        let items = value.get_ref().as_array();
        let items = items.ok_or_else(|| self.wrong(value, key, wanted))?;
        self.check_count(value.span().start, items.len())?;
        items.iter().map(|item| of(self, key, item)).collect()
    }

    fn check_count(&self, at: usize, entries: usize) -> Result<(), FileError> {
        if entries <= MODEL_NAMES {
            return Ok(());
        }
        let message = format!("{entries} entries; at most {MODEL_NAMES} are read");
        Err(self.document.error(at, message))
    }

    fn table_of(&self, key: &str, value: &Value<'a>) -> Result<Section<'a>, FileError> {
        let table = value
            .get_ref()
            .as_table()
            .ok_or_else(|| self.wrong(value, key, "a table"))?;
        let prefix = if self.name.is_empty() {
            String::new()
        } else {
            format!("{}.", self.name)
        };
        Ok(Section {
            document: self.document,
            name: format!("{prefix}{key}"),
            at: value.span().start,
            table: table.clone(),
        })
    }

    fn name_or_table_of(&self, key: &str, value: &Value<'a>) -> Result<NameOrTable<'a>, FileError> {
        if value.get_ref().is_table() {
            return self.table_of(key, value).map(NameOrTable::Table);
        }
        self.text_of(key, value).map(NameOrTable::Name)
    }

    fn text_of(&self, key: &str, value: &Value<'a>) -> Result<Located<String>, FileError> {
        let text = value
            .get_ref()
            .as_str()
            .ok_or_else(|| self.wrong(value, key, "a string in quotes"))?;
        Ok(Located {
            value: text.to_owned(),
            at: value.span().start,
        })
    }

    /// A finite number.
    fn number_of(&self, key: &str, value: &Value<'a>) -> Result<f64, FileError> {
        let number = self.float_of(key, value)?;
        if number.is_finite() {
            return Ok(number);
        }
        let message = format!("`{key}` is not a finite number; write one, such as 0.25");
        Err(self.document.error(value.span().start, message))
    }

    /// A number, infinite if it limits nothing.
    fn limit_of(&self, key: &str, value: &Value<'a>) -> Result<f64, FileError> {
        match self.float_of(key, value)? {
            number if number.is_nan() => Err(self.wrong(value, key, "a decimal number")),
            number => Ok(number),
        }
    }

    fn float_of(&self, key: &str, value: &Value<'a>) -> Result<f64, FileError> {
        let number = match value.get_ref() {
            DeValue::Float(number) => number.as_str().parse().ok(),
            // Whoever reads the file as plain TOML takes them for these.
            DeValue::Integer(number) => number.as_str().parse::<i64>().ok().map(|n| n as f64),
            _ => return Err(self.wrong(value, key, "a number")),
        };
        number.ok_or_else(|| self.wrong(value, key, "a decimal number"))
    }
}
