//! What the values of a file are read as.

use toml::de::DeValue;

use super::effect::{ActsOn, AlikeOn, Measure, ShowsIn, Side};
use super::filter::CommandFilter;
use super::fitted::Status;
use super::reader::{Entry, FileError, Located, Section};
use crate::data::TorqueColumn;
use crate::expr::Formula;

/// 2^53: above it, floating point skips whole numbers.
const MOST_WHOLE: f64 = 9_007_199_254_740_992.0;

/// What the value of a key is read as.
pub(super) trait Read<'a>: Sized {
    /// One of them in messages, and several.
    const NAMES: [&'static str; 2];

    fn read(entry: Entry<'_, 'a>) -> Result<Self, FileError>;

    /// What it means if `key` is left out.
    fn absent(section: &Section<'a>, key: &str) -> Result<Self, FileError> {
        let name = &section.name;
        let [wanted, _] = Self::NAMES;
        Err(section.error(format!("`{key}` is missing in [{name}]; give {wanted}")))
    }
}

/// Every key of a table with what it holds, in the order of the file; none without the table.
pub(super) struct Named<T>(pub Vec<(String, T)>);

/// A plain value, or a table that says more.
pub(super) enum OrTable<T, U> {
    Plain(T),
    Table(U),
}

/// Two numbers, each infinite if it limits nothing.
pub(super) struct Limits(pub [f64; 2]);

/// The name of a log's column, or its number, from 1.
pub(super) struct ColumnName(pub String);

/// A joint by its name or its number, from 1, and where it stands in the file.
pub(super) struct JointKey {
    pub key: String,
    pub at: usize,
}

/// What has a separate value of an effect's parameter.
#[derive(Clone, Copy)]
pub(super) struct EachLog;

/// What has a separate value of a declared parameter.
#[derive(Clone, Copy)]
pub(super) enum Per {
    Log,
    Group,
}

impl<'a, T: Read<'a>> Read<'a> for Option<T> {
    const NAMES: [&'static str; 2] = T::NAMES;

    fn read(entry: Entry<'_, 'a>) -> Result<Self, FileError> {
        T::read(entry).map(Some)
    }

    fn absent(_: &Section<'a>, _: &str) -> Result<Self, FileError> {
        Ok(None)
    }
}

impl<'a> Read<'a> for Section<'a> {
    const NAMES: [&'static str; 2] = ["a table", "tables, written [[..]]"];

    fn read(entry: Entry<'_, 'a>) -> Result<Self, FileError> {
        let table = entry.value().as_table();
        let table = table.ok_or_else(|| entry.wrong(Self::NAMES[0]))?;
        let name = [entry.section.name.as_str(), entry.key];
        Ok(Section {
            document: entry.section.document,
            name: name.join(".").trim_start_matches('.').to_owned(),
            at: entry.at(),
            table: table.clone(),
        })
    }

    fn absent(section: &Section<'a>, key: &str) -> Result<Self, FileError> {
        Err(section.error(format!("the table [{key}] is missing")))
    }
}

impl<'a, T: Read<'a>> Read<'a> for Named<T> {
    const NAMES: [&'static str; 2] = Section::NAMES;

    fn read(entry: Entry<'_, 'a>) -> Result<Self, FileError> {
        <Section<'a> as Read<'a>>::read(entry)?.entries().map(Self)
    }

    fn absent(_: &Section<'a>, _: &str) -> Result<Self, FileError> {
        Ok(Self(Vec::new()))
    }
}

impl<'a, T: Read<'a>, U: Read<'a>> Read<'a> for OrTable<T, U> {
    const NAMES: [&'static str; 2] = [T::NAMES[0], "names or tables"];

    fn read(entry: Entry<'_, 'a>) -> Result<Self, FileError> {
        match entry.value().is_table() {
            true => U::read(entry).map(Self::Table),
            false => T::read(entry).map(Self::Plain),
        }
    }
}

/// Empty if absent.
impl<'a, T: Read<'a>> Read<'a> for Vec<T> {
    const NAMES: [&'static str; 2] = ["a list", "rows"];

    fn read(entry: Entry<'_, 'a>) -> Result<Self, FileError> {
        let items = entry.items(&format!("a list of {}", T::NAMES[1]))?;
        items.map(T::read).collect()
    }

    fn absent(_: &Section<'a>, _: &str) -> Result<Self, FileError> {
        Ok(Self::new())
    }
}

impl<'a, T: Read<'a>, const N: usize> Read<'a> for [T; N] {
    const NAMES: [&'static str; 2] = ["a list", "values"];

    fn read(entry: Entry<'_, 'a>) -> Result<Self, FileError> {
        let wanted = format!("a list of {N} {}", T::NAMES[1]);
        let items = entry.items(&wanted)?.map(T::read);
        let items: Result<Self, _> = items.collect::<Result<Vec<_>, _>>()?.try_into();
        items.map_err(|_| entry.error(format!("`{}` must be {wanted}", entry.key)))
    }
}

impl Read<'_> for String {
    const NAMES: [&'static str; 2] = ["a string in quotes", "strings"];

    fn read(entry: Entry<'_, '_>) -> Result<Self, FileError> {
        let text = entry.value().as_str();
        text.map(str::to_owned)
            .ok_or_else(|| entry.wrong(Self::NAMES[0]))
    }
}

impl Read<'_> for Located<String> {
    const NAMES: [&'static str; 2] = String::NAMES;

    fn read(entry: Entry<'_, '_>) -> Result<Self, FileError> {
        let at = entry.at();
        String::read(entry).map(|value| Self { value, at })
    }
}

impl Read<'_> for Located<Formula> {
    const NAMES: [&'static str; 2] = ["a formula in quotes", "formulas"];

    fn read(entry: Entry<'_, '_>) -> Result<Self, FileError> {
        let (text, at) = (entry.value().as_str(), entry.at());
        let text = text.ok_or_else(|| entry.wrong(Self::NAMES[0]))?;
        let value = entry.section.document.formula(at, text)?;
        Ok(Self { value, at })
    }
}

/// False if absent.
impl<'a> Read<'a> for bool {
    const NAMES: [&'static str; 2] = ["true or false", "values"];

    fn read(entry: Entry<'_, 'a>) -> Result<Self, FileError> {
        let flag = entry.value().as_bool();
        flag.ok_or_else(|| entry.wrong(Self::NAMES[0]))
    }

    fn absent(_: &Section<'a>, _: &str) -> Result<Self, FileError> {
        Ok(false)
    }
}

/// A finite number.
impl Read<'_> for f64 {
    const NAMES: [&'static str; 2] = ["a number", "numbers"];

    fn read(entry: Entry<'_, '_>) -> Result<Self, FileError> {
        let number = number(entry)?;
        if number.is_finite() {
            return Ok(number);
        }
        let key = entry.key;
        Err(entry.error(format!(
            "`{key}` is not a finite number; write one, such as 0.25"
        )))
    }
}

/// A whole number, also if it is written as `2.0`.
impl Read<'_> for usize {
    const NAMES: [&'static str; 2] = ["a whole number", "whole numbers"];

    fn read(entry: Entry<'_, '_>) -> Result<Self, FileError> {
        let number = f64::read(entry)?;
        if number.fract() != 0.0 || !(0.0..MOST_WHOLE).contains(&number) {
            let message = format!("`{}` must be {}, found {number}", entry.key, Self::NAMES[0]);
            return Err(entry.error(message));
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // just checked
        Ok(number as Self)
    }
}

impl Read<'_> for ColumnName {
    const NAMES: [&'static str; 2] = ["a name or a number", "names or numbers"];

    fn read(entry: Entry<'_, '_>) -> Result<Self, FileError> {
        if !matches!(entry.value(), DeValue::Float(_) | DeValue::Integer(_)) {
            return String::read(entry).map(Self);
        }
        match usize::read(entry)? {
            0 => Err(entry.error("columns are counted from 1".to_owned())),
            number => Ok(Self(number.to_string())),
        }
    }
}

impl Read<'_> for JointKey {
    const NAMES: [&'static str; 2] = ColumnName::NAMES;

    fn read(entry: Entry<'_, '_>) -> Result<Self, FileError> {
        let key = match entry.value() {
            DeValue::Integer(_) => usize::read(entry)?.to_string(),
            _ => String::read(entry)?,
        };
        Ok(Self {
            key,
            at: entry.at(),
        })
    }
}

impl Read<'_> for Limits {
    const NAMES: [&'static str; 2] = ["a list of 2 numbers", "values"];

    fn read(entry: Entry<'_, '_>) -> Result<Self, FileError> {
        let numbers = entry.items(Self::NAMES[0])?.map(number);
        match numbers.collect::<Result<Vec<_>, _>>()?[..] {
            [low, high] if !low.is_nan() && !high.is_nan() => Ok(Self([low, high])),
            _ => Err(entry.error(format!("`{}` must be {}", entry.key, Self::NAMES[0]))),
        }
    }
}

/// A value that is one of a few words.
trait Word: Copy + 'static {
    const WORDS: &'static [(&'static str, Self)];
}

impl Word for Measure {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("speed", Self::Speed),
        ("torque", Self::Torque),
        ("inertia", Self::Inertia),
        ("duration", Self::Duration),
    ];
}

impl Word for CommandFilter {
    const WORDS: &'static [(&'static str, Self)] = &[("delay", Self::Delay), ("lag", Self::Lag)];
}

impl Word for TorqueColumn {
    const WORDS: &'static [(&'static str, Self)] = &[
        (Self::Held.key(), Self::Held),
        (Self::Sampled.key(), Self::Sampled),
        (Self::Mean.key(), Self::Mean),
    ];
}

impl Word for ActsOn {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("all", Self::All),
        ("first", Self::First),
        ("turning", Self::Turning),
    ];
}

impl Word for ShowsIn {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("any", Self::Any),
        ("torques", Self::Torques),
        ("law torques", Self::LawTorques),
        ("law", Self::Law),
    ];
}

impl Word for AlikeOn {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("none", Self::None),
        ("like joints", Self::LikeJoints),
        ("commanded", Self::Commanded),
    ];
}

impl Word for Side {
    const WORDS: &'static [(&'static str, Self)] = &[("link", Self::Link), ("motor", Self::Motor)];
}

impl Word for EachLog {
    const WORDS: &'static [(&'static str, Self)] = &[("log", Self)];
}

impl Word for Per {
    const WORDS: &'static [(&'static str, Self)] = &[("log", Self::Log), ("group", Self::Group)];
}

impl Word for Status {
    const WORDS: &'static [(&'static str, Self)] = &[
        (Self::Established.name(), Self::Established),
        (Self::Supported.name(), Self::Supported),
    ];
}

impl<T: Word> Read<'_> for T {
    const NAMES: [&'static str; 2] = String::NAMES;

    fn read(entry: Entry<'_, '_>) -> Result<Self, FileError> {
        let text = String::read(entry)?;
        let mut words = T::WORDS.iter();
        let chosen = words.find(|(word, _)| *word == text);
        chosen.map(|(_, chosen)| *chosen).ok_or_else(|| {
            let words = T::WORDS.iter().map(|(word, _)| format!("{word:?}"));
            let words = words.collect::<Vec<_>>().join(" or ");
            entry.error(format!("`{}` must be {words}, found {text:?}", entry.key))
        })
    }
}

fn number(entry: Entry<'_, '_>) -> Result<f64, FileError> {
    let number = match entry.value() {
        DeValue::Float(number) => number.as_str().parse().ok(),
        // Whoever reads the file as plain TOML takes them for these.
        DeValue::Integer(number) => number.as_str().parse::<i64>().ok().map(|n| n as f64),
        _ => return Err(entry.wrong("a number")),
    };
    number.ok_or_else(|| entry.wrong("a decimal number"))
}
