//! Reads a description and its weights back, as a checkpoint.

use std::path::{Path, PathBuf};

use serde_json::Value;
use thiserror::Error;

use super::description::{Description, VERSION};
use residyn_core::model::weights::from_bytes;
use residyn_core::model::{
    Dynamics, Effect, FileError, Model, ModelShape, ModelWeights, SavedModelError,
};
use residyn_io::files::read_saved;

/// A model read back from its two files.
#[derive(Debug)]
pub struct Imported {
    pub description: Description,
    /// What its model file says.
    pub system: Model,
    /// Values of the parameters, and the networks.
    pub numbers: ModelWeights,
}

/// Why a description cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImportError {
    #[error("{path} cannot be read: {source}; give a JSON description that `residyn export` wrote", path = .path.display())]
    Unreadable {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path}: {source}; it must be a JSON description that `residyn export` wrote", path = .path.display())]
    Json {
        path: PathBuf,
        source: serde_json::Error,
    },
    #[error("{path} has format {found}, this program reads {VERSION}; use the residyn that wrote it ({by})", path = .path.display())]
    Version {
        path: PathBuf,
        found: u64,
        by: String,
    },
    #[error("{path}: the parameters of its model file are {file}, those of its weights {weights}; use another copy", path = .path.display())]
    Foreign {
        path: PathBuf,
        file: String,
        weights: String,
    },
    #[error("{path}: `joints` is {found}, its model file has {expected}; use another copy", path = .path.display())]
    Joints {
        path: PathBuf,
        found: usize,
        expected: usize,
    },
    #[error("{path}: its weights are in {weights}, which is a link or in another folder; put the weights in a file next to the description", path = .path.display(), weights = .weights.display())]
    Elsewhere { path: PathBuf, weights: PathBuf },
    #[error(transparent)]
    Model(#[from] FileError),
    #[error(transparent)]
    Weights(#[from] SavedModelError),
}

impl Imported {
    /// Version of the program that wrote it.
    pub fn written_by(&self) -> &str {
        &self.description.residyn
    }

    /// Read a description and the weights next to it. Effects in its model file are looked up in `effects`.
    ///
    /// # Errors
    /// A missing or damaged file, another version, or files that do not belong together.
    pub fn read(path: &Path, effects: &[Effect]) -> Result<Self, ImportError> {
        let description = description(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let weights = weights_of(path, &description.weights)?;
        let bytes = read_saved(&weights).map_err(|source| ImportError::Unreadable {
            path: weights.clone(),
            source,
        })?;
        let shape = &description.shape;
        let file = description.weights.to_string_lossy();
        let numbers = from_bytes(shape, &bytes, &file, folder)?;
        let system = Model::from_text(path, &description.model_toml, effects)?;
        let dynamics = system.dynamics();
        check(path, shape, &dynamics)?;
        Ok(Self {
            description,
            system,
            numbers,
        })
    }
}

/// The description in `path`. Its version is checked first, since another version may describe everything else
/// differently.
fn description(path: &Path) -> Result<Description, ImportError> {
    let path = path.to_owned();
    let json = read_saved(&path).map_err(|source| ImportError::Unreadable {
        path: path.clone(),
        source,
    })?;
    let invalid = |source| ImportError::Json {
        path: path.clone(),
        source,
    };
    let json: Value = serde_json::from_slice(&json).map_err(invalid)?;
    match json["residyn_model"].as_u64() {
        Some(found) if found != VERSION => Err(ImportError::Version {
            found,
            by: json["residyn"].as_str().unwrap_or("unknown").to_owned(),
            path,
        }),
        _ => serde_json::from_value(json).map_err(invalid),
    }
}

/// The file of weights next to a description: a description from elsewhere must not name any other file.
fn weights_of(path: &Path, named: &Path) -> Result<PathBuf, ImportError> {
    let weights = path.with_file_name(named);
    let is_name = named.file_name() == Some(named.as_os_str());
    if !is_name || weights.is_symlink() {
        return Err(ImportError::Elsewhere {
            path: path.to_owned(),
            weights: named.to_owned(),
        });
    }
    Ok(weights)
}

/// Refuse weights for other joints or parameters. A network as prior needs no equations, so its model file may have
/// any.
fn check(path: &Path, shape: &ModelShape, declared: &Dynamics) -> Result<(), ImportError> {
    if shape.joints != declared.joints {
        return Err(ImportError::Joints {
            path: path.to_owned(),
            found: shape.joints,
            expected: declared.joints,
        });
    }
    let parameters = declared.parameters.iter();
    let file: Vec<&str> = parameters.map(|p| p.name.as_str()).collect();
    let weights: Vec<&str> = shape.parameters.iter().map(|p| p.name.as_str()).collect();
    if shape.prior.is_some() || file == weights {
        return Ok(());
    }
    Err(ImportError::Foreign {
        path: path.to_owned(),
        file: file.join(", "),
        weights: weights.join(", "),
    })
}
