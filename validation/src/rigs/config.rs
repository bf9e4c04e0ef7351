//! A file of measured rigs: their logs, declared models and published parameter sets.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;
use toml::Spanned;

use residyn_core::data::LeaveOut;
use residyn_core::toml_text::from_toml;
use residyn_io::files::{beside_or_named, read_text};

/// Why measured rigs cannot be run.
#[derive(Debug, Error)]
pub enum RigsError {
    #[error("{path}: cannot be read: {source}", path = .path.display())]
    Open {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path}, line {line}: {message}", path = .path.display())]
    File {
        path: PathBuf,
        line: usize,
        message: String,
    },
    #[error("{rig}: there is no folder {folder}", folder = .folder.display())]
    NoLogs { rig: String, folder: PathBuf },
    /// A model, a log or a name that does not fit the rig.
    #[error("{rig}: {source}")]
    Rig {
        rig: String,
        source: Box<dyn Error + Send + Sync>,
    },
}

impl RigsError {
    /// What is wrong with this rig.
    pub(super) fn of<E: Into<Box<dyn Error + Send + Sync>>>(rig: &Rig) -> impl Fn(E) -> Self {
        |source| Self::Rig {
            rig: rig.name.clone(),
            source: source.into(),
        }
    }
}

/// Which logs of a rig train a model and which test it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Test {
    /// Each log in turn is the test log of a model fitted to the others.
    EachLog,
    /// One half of each log trains and the other tests, and vice versa.
    Halves,
}

/// A model file with other values of some of its parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Declared {
    /// A model file, or the name of a built-in system.
    pub model: PathBuf,
    pub parameters: BTreeMap<String, f64>,
}

/// A published parameter set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Published {
    pub name: String,
    pub model: Declared,
}

/// A measured rig as its file describes it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rig {
    pub name: String,
    /// Folder of its logs, within the folder of measured logs.
    pub folder: PathBuf,
    pub declared: Declared,
    pub logs: Vec<String>,
    pub test: Test,
    /// Intervals that are neither fitted nor scored, each as `LOG@T0-T1`.
    pub leave_out: Vec<String>,
    /// Effects on every joint.
    pub plain: Vec<String>,
    pub published: Vec<Published>,
    /// Test logs, by group, of a model fitted to all of `logs`.
    pub also: BTreeMap<String, Vec<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    plain: Vec<String>,
    rig: Vec<Spanned<Entry>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    folder: PathBuf,
    model: PathBuf,
    #[serde(default)]
    parameters: BTreeMap<String, f64>,
    logs: Spanned<Vec<String>>,
    test: Test,
    #[serde(default)]
    leave_out: Vec<Spanned<String>>,
    #[serde(default)]
    published: Vec<PublishedEntry>,
    #[serde(default)]
    also: BTreeMap<String, Vec<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PublishedEntry {
    name: String,
    model: PathBuf,
    #[serde(default)]
    parameters: BTreeMap<String, f64>,
}

/// All rigs of a file, in its order.
///
/// # Errors
/// A file that cannot be read or describes no rigs.
pub fn read(path: &Path) -> Result<Vec<Rig>, RigsError> {
    let text = read_text(path).map_err(|source| RigsError::Open {
        path: path.to_owned(),
        source,
    })?;
    rigs(path, &text)
}

/// The rigs in `text`; file names in it are relative to `path`.
fn rigs(path: &Path, text: &str) -> Result<Vec<Rig>, RigsError> {
    let wrong = |at: usize, message: String| RigsError::File {
        path: path.to_owned(),
        line: text[..at].matches('\n').count() + 1,
        message,
    };
    let start = |error: &toml::de::Error| error.span().map_or(0, |span| span.start);
    let file: File =
        from_toml(text).map_err(|error| wrong(start(&error), error.message().to_owned()))?;
    let mut rigs: Vec<Rig> = Vec::new();
    for entry in file.rig {
        let at = entry.span().start;
        let entry = entry.into_inner();
        check(&entry).map_err(|(at, message)| wrong(at, message))?;
        if rigs.iter().any(|rig| rig.name == entry.name) {
            let message = format!(
                "a rig called {:?} is listed above; give another name",
                entry.name
            );
            return Err(wrong(at, message));
        }
        rigs.push(entry.rig(path, &file.plain));
    }
    Ok(rigs)
}

/// Check what the form of a rig's entry does not ensure; an error has its place, in bytes.
fn check(entry: &Entry) -> Result<(), (usize, String)> {
    let least = match entry.test {
        Test::EachLog => 2,
        Test::Halves => 1,
    };
    if entry.logs.get_ref().len() < least {
        let message = format!("this `test` needs {least} log(s); list more, or test by `halves`");
        return Err((entry.logs.span().start, message));
    }
    for text in &entry.leave_out {
        let parsed = text.get_ref().parse::<LeaveOut>();
        parsed.map_err(|error| (text.span().start, error.to_string()))?;
    }
    Ok(())
}

impl Entry {
    fn rig(self, path: &Path, plain: &[String]) -> Rig {
        let declared = |model: &Path, parameters| Declared {
            model: beside_or_named(path, model),
            parameters,
        };
        let published = self.published.into_iter().map(|entry| Published {
            name: entry.name,
            model: declared(&entry.model, entry.parameters),
        });
        Rig {
            published: published.collect(),
            name: self.name,
            folder: self.folder,
            declared: declared(&self.model, self.parameters),
            logs: self.logs.into_inner(),
            test: self.test,
            leave_out: self
                .leave_out
                .into_iter()
                .map(Spanned::into_inner)
                .collect(),
            plain: plain.to_vec(),
            also: self.also,
        }
    }
}
