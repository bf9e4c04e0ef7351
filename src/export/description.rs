//! The whole model as two files: a JSON description with the equations as a list of operations, and all learnable
//! numbers as safetensors. Enough to rebuild the model elsewhere, or here.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use thiserror::Error;

use super::{CarriedEffect, ExportError, File, Format, HeldFilter, Portable, Reader, rebuilt};
use crate::expr::{Op, Program};
use crate::model::weights::{from_bytes, to_bytes};
use crate::model::{Effect, Integrator, ModelShape, ModelWeights, SavedModelError, System};

pub(super) const JSON: Format = Format {
    name: "json",
    about: "the whole model as a description, its weights beside it as safetensors",
    limits: |_| Vec::new(),
    files: |model, path| pair(model, path, &path.with_extension(WEIGHTS)),
    reader: Reader::Own(rebuilt::answers),
    tolerance: 1e-12,
};

pub(super) const SAFETENSORS: Format = Format {
    name: "safetensors",
    about: "weights, the description of the whole model beside them as JSON",
    files: |model, path| pair(model, &path.with_extension(DESCRIPTION), path),
    reader: Reader::Own(|path, samples| {
        rebuilt::answers(&path.with_extension(DESCRIPTION), samples)
    }),
    ..JSON
};

const DESCRIPTION: &str = "json";
const WEIGHTS: &str = "safetensors";

/// The number of the description's own format.
const VERSION: u64 = 1;

/// The JSON file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Description {
    /// The number of this format.
    pub residyn_model: u64,
    /// The program that wrote it.
    pub residyn: String,
    pub about: String,
    #[serde(flatten)]
    pub shape: ModelShape,
    /// For each joint whether it slides (m, N) rather than turns (rad, N m).
    pub prismatic: Vec<bool>,
    pub integrator: Integrator,
    pub step_s: f64,
    /// The file of the learnable numbers, beside this one.
    pub weights: PathBuf,
    /// Text of the model file.
    pub model_toml: String,
    /// What the model came of.
    pub origin: Value,
    /// For readers that know no model files.
    #[serde(skip_deserializing)]
    equations: Equations,
}

/// What follows from the rest: the equations, as they are carried out.
#[derive(Debug, Clone, Default, Serialize)]
struct Equations {
    /// The numbers in the file of weights once more, with what is known of them.
    parameters: Vec<Value>,
    effects: Vec<CarriedEffect>,
    /// What commanded torques go through before they act.
    filters: Vec<Value>,
    /// The same for the step of the file: `mean` torques over each substep and what the lag has come to at the `end`, as
    /// sums of factors times the lagged torque and the torques at two `places`.
    held: Vec<HeldFilter>,
    /// The rates around the networks, as formulas.
    formulas: String,
    /// Names of the inputs of the operations.
    inputs: Vec<String>,
    /// `["input", k]`, `["const", x]` or a function and the positions of its arguments in this list.
    operations: Vec<Value>,
    /// Positions of the rates of positions, then of velocities.
    outputs: Vec<usize>,
    /// Prefixes of the networks' tensors, in the order in which their outputs are added to the last of the rates.
    networks: Vec<&'static str>,
}

/// A model read back from its two files.
#[derive(Debug)]
pub struct Imported {
    pub description: Description,
    pub system: System,
    pub numbers: ModelWeights,
}

/// Why a description cannot be read.
#[derive(Debug, Error)]
pub enum ImportError {
    #[error("{path} cannot be read: {source}; give the JSON file that `residyn export --format json` wrote", path = .path.display())]
    Unreadable {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path}: {source}; it must be the JSON file that `residyn export --format json` wrote", path = .path.display())]
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
    #[error("{path}: the parameters of its model file are {file}, those of its weights {weights}; take another copy", path = .path.display())]
    Foreign {
        path: PathBuf,
        file: String,
        weights: String,
    },
    #[error(transparent)]
    Model(#[from] crate::model::FileError),
    #[error(transparent)]
    Weights(#[from] SavedModelError),
}

fn pair(model: &Portable, description: &Path, weights: &Path) -> Result<Vec<File>, ExportError> {
    if description == weights {
        return Err(ExportError::Model {
            format: "a pair of files",
            system: model.name().to_owned(),
            reason: format!(
                "both would be {}; give --out a name that ends in .{DESCRIPTION} or .{WEIGHTS}",
                description.display()
            ),
        });
    }
    let numbers = model.weights();
    let shape = ModelShape::of(
        model.name(),
        model.joints(),
        &model.equations.parameters,
        &numbers,
    );
    let bytes = to_bytes(&shape, &numbers);
    let text = Description {
        residyn_model: VERSION,
        residyn: env!("CARGO_PKG_VERSION").to_owned(),
        about: model.system.about.clone(),
        shape,
        prismatic: model.system.prismatic.clone(),
        integrator: model.integrator,
        step_s: model.step_s,
        weights: weights.file_name().map(PathBuf::from).unwrap_or_default(),
        model_toml: model.system.text.clone(),
        origin: model.origin.clone(),
        equations: Equations::of(model),
    };
    let mut json = serde_json::to_vec_pretty(&text).expect("a description is numbers and text");
    json.push(b'\n');
    Ok(vec![
        File {
            path: description.to_owned(),
            bytes: json,
            about: "description of the whole model".into(),
        },
        File {
            path: weights.to_owned(),
            bytes,
            about: "parameters and weights".into(),
        },
    ])
}

impl Equations {
    fn of(model: &Portable) -> Self {
        let equations = &model.equations;
        let program = &equations.program;
        let names: Vec<String> = (["q", "qd"].iter())
            .flat_map(|stem| (1..=model.joints()).map(move |j| format!("d({stem}{j})/dt")))
            .collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        Self {
            parameters: equations.parameters.iter().map(parameter).collect(),
            effects: model.effects.clone(),
            filters: (equations.filters.iter())
                .map(|filter| {
                    let name = &equations.parameters[filter.parameter].name;
                    json!({"joint": filter.joint + 1, "kind": filter.kind, "parameter": name})
                })
                .collect(),
            held: HeldFilter::all(model),
            formulas: program.text(&names),
            inputs: program.inputs().to_vec(),
            operations: operations(program),
            outputs: program.outputs().iter().map(|node| node.index()).collect(),
            networks: model.prefixed().map(|(prefix, _)| prefix).collect(),
        }
    }
}

fn parameter(parameter: &crate::model::Parameter) -> Value {
    json!({
        "name": parameter.name, "value": parameter.value, "unit": parameter.unit,
        "ci95": parameter.ci95, "fixed": parameter.fixed,
    })
}

fn operations(program: &Program) -> Vec<Value> {
    let operation = |op: &Op| match op {
        Op::Input(k) => json!(["input", k]),
        Op::Const(value) => json!(["const", value]),
        Op::Unary(f, a) => json!([f, a.index()]),
        Op::Binary(f, a, b) => json!([f, a.index(), b.index()]),
        Op::Where(c, a, b) => json!(["where", c.index(), a.index(), b.index()]),
    };
    program.ops().iter().map(operation).collect()
}

impl Imported {
    /// Read a description and the weights beside it. `effects` is where the effects of its model file are looked up.
    ///
    /// # Errors
    /// A missing or damaged file, another format, or files that do not belong together.
    pub fn read(path: &Path, effects: &[Effect]) -> Result<Self, ImportError> {
        let description = Description::read(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let weights = folder.join(&description.weights);
        let bytes = std::fs::read(&weights).map_err(|source| ImportError::Unreadable {
            path: weights.clone(),
            source,
        })?;
        let shape = &description.shape;
        let file = description.weights.to_string_lossy();
        let numbers = from_bytes(shape, &bytes, &file, folder)?;
        let system = System::from_text(path, &description.model_toml, effects)?;
        let dynamics = system.dynamics(&system.sign());
        check(path, shape, &dynamics.parameters)?;
        Ok(Self {
            description,
            system,
            numbers,
        })
    }
}

impl Description {
    /// The format is looked at first: another one may describe anything else differently.
    fn read(path: &Path) -> Result<Self, ImportError> {
        let path = path.to_owned();
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(source) => return Err(ImportError::Unreadable { path, source }),
        };
        let found =
            (serde_json::from_slice::<Value>(&bytes)).and_then(|json| match json["residyn_model"]
                .as_u64()
            {
                Some(found) if found != VERSION => Ok(Err((
                    found,
                    json["residyn"].as_str().unwrap_or("unknown").to_owned(),
                ))),
                _ => serde_json::from_value(json).map(Ok),
            });
        match found {
            Ok(Ok(description)) => Ok(description),
            Ok(Err((found, by))) => Err(ImportError::Version { path, found, by }),
            Err(source) => Err(ImportError::Json { path, source }),
        }
    }
}

/// A network needs no equations, so those of the model file may be any.
fn check(
    path: &Path,
    shape: &ModelShape,
    declared: &[crate::model::Parameter],
) -> Result<(), ImportError> {
    let file: Vec<&str> = declared.iter().map(|p| p.name.as_str()).collect();
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
