//! Hand-written TOML, table by table. Errors name file, line and column; for an unknown key they suggest a similar known
//! one.

use std::cell::Cell;
use std::fmt;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::values::Read;
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

impl Located<Formula> {
    /// The names that it mentions, each with the formula's place.
    pub fn names(&self) -> impl Iterator<Item = (&str, usize)> {
        self.value.names().into_iter().map(|name| (name, self.at))
    }
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

    pub fn formula(&self, at: usize, text: &str) -> Result<Formula, FileError> {
        let formula = parse_finite(text).map_err(|error| self.formula_error(at, &error))?;
        self.terms.update(|terms| terms + formula.terms());
        if self.terms.get() > MODEL_TERMS {
            let message = format!(
                "the formulas up to here have more than {MODEL_TERMS} numbers, names and operations; describe a large \
                 mechanism under [chain]"
            );
            return Err(self.error(at, message));
        }
        Ok(formula)
    }

    /// Refuse a formula that mentions names other than `known`.
    pub fn check_names<'n>(
        &self,
        at: usize,
        formula: &Formula,
        known: impl IntoIterator<Item = &'n str>,
    ) -> Result<(), FileError> {
        let lowered = formula.program(known);
        lowered.map_or_else(|error| Err(self.formula_error(at, &error)), |_| Ok(()))
    }
}

/// One table of the file.
pub(super) struct Section<'a> {
    pub document: &'a Document,
    /// As in the header, empty for the top level.
    pub name: String,
    pub at: usize,
    pub table: DeTable<'a>,
}

/// A key of a table, with its value.
#[derive(Clone, Copy)]
pub(super) struct Entry<'s, 'a> {
    pub section: &'s Section<'a>,
    pub key: &'s str,
    value: &'s Spanned<DeValue<'a>>,
}

impl<'a> Section<'a> {
    /// What `key` holds.
    pub fn read<T: Read<'a>>(&self, key: &str) -> Result<T, FileError> {
        match self.table.get(key) {
            Some(value) => T::read(self.entry(key, value)),
            None => T::absent(self, key),
        }
    }

    /// Every key with what it holds, in the order of the file.
    pub fn entries<T: Read<'a>>(&self) -> Result<Vec<(String, T)>, FileError> {
        self.check_count(self.at, self.table.len())?;
        let entries = self.table.iter();
        entries
            .map(|(key, value)| {
                let entry = self.entry(key.get_ref(), value);
                Ok((entry.key.to_owned(), T::read(entry)?))
            })
            .collect()
    }

    fn entry<'s>(&'s self, key: &'s str, value: &'s Spanned<DeValue<'a>>) -> Entry<'s, 'a> {
        Entry {
            section: self,
            key,
            value,
        }
    }

    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// Refuse keys other than `known`.
    pub fn only(&self, known: &[&str]) -> Result<(), FileError> {
        let mut keys = self.table.keys();
        let Some(stranger) = keys.find(|key| !known.contains(&key.get_ref().as_ref())) else {
            return Ok(());
        };
        let within = match self.name.as_str() {
            "" => String::new(),
            name => format!(" in [{name}]"),
        };
        let remedy = match suggestion(stranger.get_ref(), known.iter().copied()) {
            near if near.is_empty() => format!("; known are {}", known.join(", ")),
            near => near,
        };
        let message = format!("unknown key `{}`{within}{remedy}", stranger.get_ref());
        Err(self.document.error(stranger.span().start, message))
    }

    /// An error at this table.
    pub fn error(&self, message: impl Into<String>) -> FileError {
        self.document.error(self.at, message)
    }

    /// An error at the value of `key`.
    pub fn error_at(&self, key: &str, message: impl Into<String>) -> FileError {
        self.document.error(self.place(key), message)
    }

    /// Refuse a formula, the value of `key`, that mentions names other than `known`.
    pub fn check_names<'n>(
        &self,
        key: &str,
        formula: &Formula,
        known: impl IntoIterator<Item = &'n str>,
    ) -> Result<(), FileError> {
        self.document.check_names(self.place(key), formula, known)
    }

    /// Where the value of `key` starts, or else the table.
    fn place(&self, key: &str) -> usize {
        let value = self.table.get(key);
        value.map_or(self.at, |value| value.span().start)
    }

    fn check_count(&self, at: usize, entries: usize) -> Result<(), FileError> {
        if entries <= MODEL_NAMES {
            return Ok(());
        }
        let message = format!("{entries} entries; at most {MODEL_NAMES} are read");
        Err(self.document.error(at, message))
    }
}

impl<'s, 'a> Entry<'s, 'a> {
    pub fn value(self) -> &'s DeValue<'a> {
        self.value.get_ref()
    }

    pub fn at(self) -> usize {
        self.value.span().start
    }

    /// The items of a list.
    pub fn items(
        self,
        wanted: &str,
    ) -> Result<impl Iterator<Item = Self> + use<'s, 'a>, FileError> {
        let items = self.value().as_array();
        let items = items.ok_or_else(|| self.wrong(wanted))?;
        self.section.check_count(self.at(), items.len())?;
        Ok(items.iter().map(move |value| Self { value, ..self }))
    }

    /// An error at the value.
    pub fn error(self, message: impl Into<String>) -> FileError {
        self.section.document.error(self.at(), message)
    }

    /// The error for a value of another type than is wanted.
    pub fn wrong(self, wanted: &str) -> FileError {
        let found = self.value().type_str();
        self.error(format!("`{}` must be {wanted}, found {found}", self.key))
    }
}
