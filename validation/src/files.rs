//! Cells whose logs another program recorded.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::grid::{Cell, GridError, Group, Source, id};
use super::hidden::Hidden;
use residyn_io::files::{beside_or_named, read_text};

/// The contents of `cell.json`: what is known of the logs next to it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Described {
    group: Group,
    plant: String,
    /// The program that recorded the logs.
    recorded_by: String,
    /// A model file, relative to the grid, or the name of a built-in system.
    model: PathBuf,
    effects: Vec<Hidden>,
    logs: Vec<PathBuf>,
    #[serde(default)]
    declared: BTreeMap<String, f64>,
}

/// One cell for each folder in `folder`, in the order of their names; model files are relative to `grid`.
///
/// # Errors
/// A folder without a readable `cell.json`.
pub fn recorded(folder: &Path, grid: &Path) -> Result<Vec<Cell>, GridError> {
    let unreadable = |source| GridError::Open {
        path: folder.to_owned(),
        source,
    };
    let entries = std::fs::read_dir(folder).map_err(unreadable)?;
    let mut folders: Vec<PathBuf> = entries
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()
        .map_err(unreadable)?;
    folders.sort();
    let cells = folders.iter().zip(1..);
    cells
        .map(|(folder, number)| cell(folder, number, grid))
        .collect()
}

fn cell(folder: &Path, number: u64, grid: &Path) -> Result<Cell, GridError> {
    let path = folder.join("cell.json");
    let text = read_text(&path).map_err(|source| GridError::Open {
        path: path.clone(),
        source,
    })?;
    let described: Described = serde_json::from_str(&text).map_err(|error| GridError::File {
        path,
        message: error.to_string(),
    })?;
    Ok(Cell {
        id: id(
            &described.plant,
            &described.effects,
            &described.recorded_by,
            number,
        ),
        group: described.group,
        plant: described.plant,
        condition: described.recorded_by,
        effects: described.effects,
        seed: number,
        model: beside_or_named(grid, &described.model),
        start: BTreeMap::new(),
        source: Source::Files {
            logs: described.logs.iter().map(|log| folder.join(log)).collect(),
            declared: described.declared,
        },
    })
}
