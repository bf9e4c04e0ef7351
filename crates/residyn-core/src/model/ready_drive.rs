//! Common drives, ready to be written into model files.

use std::path::Path;

use toml_edit::{DocumentMut, InlineTable, Item, Table};

use super::assemble::lower;
use super::error::ModelError;
use super::fitted::unit_on;
use super::reader::{Document, FileError, Section};
use super::sections;
use super::tables::{DriveFile, DriveTable};
use crate::data::{Joint, Quantity};
use crate::expr::{Formula, Graph, Scope, SignForm, suggestion};

/// Quantities of its joint that a drive file's formulas may mention besides the parameters.
const NAMES: [&str; 4] = ["q", "qd", Quantity::Command.key(), "t"];

/// A drive of one joint: one file of `models/drives`.
#[derive(Debug, Clone)]
pub struct ReadyDrive {
    pub name: String,
    /// What it is, and what its command is.
    pub about: String,
    torque: Formula,
    /// Entries as in `[parameters]` of a model file, without the number of a joint.
    parameters: Vec<(String, InlineTable)>,
}

impl ReadyDrive {
    /// The drive in `text`; `path` is for messages.
    ///
    /// # Errors
    /// Unknown or missing key, formula error: with line, column and remedy.
    pub fn from_text(path: &Path, text: &str) -> Result<Self, FileError> {
        let document = Document::new(path, text);
        let file = DriveFile::of(document.parse()?)?;
        let DriveTable {
            name,
            about,
            torque,
            section,
        } = file.drive;
        let given = sections::parameters(file.parameters)?;
        let own = given.iter().map(|parameter| parameter.name.as_str());
        document.check_names(torque.at, &torque.value, NAMES.into_iter().chain(own))?;
        Ok(Self {
            name,
            about,
            torque: torque.value,
            parameters: entries(&section, text)?,
        })
    }

    /// The drive of this name.
    ///
    /// # Errors
    /// Unknown name, with a similar known one.
    pub fn find(drives: Vec<Self>, name: &str) -> Result<Self, ModelError> {
        let near = suggestion(name, drives.iter().map(|drive| drive.name.as_str()));
        let mut drives = drives.into_iter();
        drives
            .find(|drive| drive.name == name)
            .ok_or_else(|| ModelError::UnknownDrive {
                name: name.to_owned(),
                near,
            })
    }

    /// The torque in terms of the command, as the file has it.
    pub fn text(&self) -> &str {
        self.torque.text()
    }

    /// Name, unit and meaning of each parameter.
    pub fn parameters(&self) -> impl Iterator<Item = [&str; 3]> {
        self.parameters.iter().map(|(name, table)| {
            let part = |key: &str| table.get(key).and_then(toml_edit::Value::as_str);
            [
                name,
                part("unit").unwrap_or(""),
                part("about").unwrap_or(""),
            ]
        })
    }

    pub(super) fn has(&self, parameter: &str) -> bool {
        self.parameters.iter().any(|(name, _)| name == parameter)
    }

    /// Write a joint's drive into a model file, with the known values of its parameters.
    pub(super) fn write_into(
        &self,
        model: &mut DocumentMut,
        joint: Joint,
        slides: bool,
        known: &[(&str, f64)],
    ) {
        add_line(model, joint, &self.formula(joint));
        for (name, table) in &self.parameters {
            let mut table = table.clone();
            if let Some((_, value)) = known.iter().find(|(known, _)| known == name) {
                table.insert("value", (*value).into());
            }
            if let Some(unit) = table.get("unit").and_then(toml_edit::Value::as_str) {
                let unit = unit_on(slides, unit);
                table.insert("unit", unit.into());
            }
            model["parameters"][&own_name(name, joint)] = toml_edit::value(table);
        }
    }

    /// The torque in the variable names of a joint.
    fn formula(&self, joint: Joint) -> String {
        let mut graph = Graph::new();
        let mut scope = Scope::new(SignForm::Exact);
        for name in NAMES {
            let of_joint = match name {
                "t" => name.to_owned(),
                stem => joint.name(stem),
            };
            let node = graph.input(&of_joint);
            scope.bind(name, node);
        }
        for (name, _) in &self.parameters {
            let node = graph.input(&own_name(name, joint));
            scope.bind(name, node);
        }
        let node = lower(&scope, &mut graph, &self.torque);
        graph.finish(&[node]).formula(0)
    }
}

/// A command that is the torque itself, in a model file in which other joints have drives.
pub(super) fn write_plain(model: &mut DocumentMut, joint: Joint) {
    add_line(model, joint, &joint.name(Quantity::Command.key()));
}

/// Keep a parameter of a joint's drive at its value in fits.
pub(super) fn hold(model: &mut DocumentMut, parameter: &str, joint: Joint) {
    let entry = &mut model["parameters"][&own_name(parameter, joint)];
    if let Some(table) = entry.as_inline_table_mut() {
        table.insert("fixed", true.into());
        table.fmt();
    }
}

/// `kp_1`
fn own_name(parameter: &str, joint: Joint) -> String {
    format!("{parameter}_{joint}")
}

fn add_line(model: &mut DocumentMut, joint: Joint, formula: &str) {
    let drive = model
        .entry("drive")
        .or_insert_with(|| Item::Table(Table::new()));
    drive[&joint.name(Quantity::Torque.key())] = toml_edit::value(formula);
}

/// The entries under `[parameters]`.
fn entries(section: &Section<'_>, text: &str) -> Result<Vec<(String, InlineTable)>, FileError> {
    let document: DocumentMut = text.parse().expect("the text was read as TOML before");
    let given = document.get("parameters").and_then(Item::as_table_like);
    let entry = |(name, item): (&str, &Item)| {
        let table = item.as_inline_table().cloned();
        let table = table.ok_or_else(|| {
            section.error(format!("write parameter `{name}` as a table in braces"))
        })?;
        Ok((name.to_owned(), table))
    };
    given
        .into_iter()
        .flat_map(|given| given.iter())
        .map(entry)
        .collect()
}
