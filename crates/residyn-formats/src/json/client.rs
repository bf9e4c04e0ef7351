//! Predicts from a description and its weights alone, like a client that knows neither model files nor effects.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::description::SavedFilter;
use crate::verify::ReferenceModel;
use crate::{ClientError, Predictions, Samples};
use residyn_core::expr::{Graph, Node, Program};
use residyn_core::model::weights::from_bytes;
use residyn_core::model::{Dynamics, Filter, InternalStates, ModelShape, ModelWeights};
use residyn_core::sim::Integrator;
use residyn_io::files::read_saved;

/// The part of a description that such a client reads.
#[derive(Deserialize)]
struct SavedModel {
    #[serde(flatten)]
    shape: ModelShape,
    integrator: Integrator,
    step_s: f64,
    weights: PathBuf,
    equations: Equations,
}

#[derive(Deserialize)]
struct Equations {
    filters: Vec<SavedFilter>,
    inputs: Vec<String>,
    states: Vec<SavedState>,
    operations: Vec<Value>,
    outputs: Vec<usize>,
}

/// The predictions of the model in `path`.
pub(super) fn predict(path: &Path, samples: &Samples) -> Result<Predictions, ClientError> {
    let failed =
        |error: &dyn std::fmt::Display| ClientError::Failed(format!("{}: {error}", path.display()));
    let bytes = read_saved(path).map_err(|error| failed(&error))?;
    let model: SavedModel = serde_json::from_slice(&bytes).map_err(|error| failed(&error))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let weights = folder.join(&model.weights);
    let bytes = read_saved(&weights).map_err(|error| failed(&error))?;
    let file = model.weights.to_string_lossy();
    let numbers =
        from_bytes(&model.shape, &bytes, &file, folder).map_err(|error| failed(&error))?;
    let model = model.reference(&numbers).map_err(|error| failed(&error))?;
    Ok(model.predict(samples))
}

/// A state of an effect.
#[derive(Deserialize)]
struct SavedState {
    name: String,
    start: f64,
}

impl SavedModel {
    fn reference(self, numbers: &ModelWeights) -> Result<ReferenceModel, String> {
        let ModelShape {
            system,
            joints,
            parameters,
            ..
        } = self.shape;
        let values = parameters.iter().zip(&numbers.parameters);
        let names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
        let equations = Dynamics {
            name: system,
            joints,
            measured: Vec::new(),
            internal: self.equations.internal(&names),
            filters: self.equations.filters(&names)?,
            program: self.equations.program()?,
            parameters: values.map(|(p, value)| p.restore(*value)).collect(),
            reading: None,
            own: Vec::new(),
            configurations: Vec::new(),
        };
        let networks = numbers.prior.iter().chain(&numbers.residual);
        ReferenceModel::new(equations, networks, self.integrator, self.step_s)
            .map_err(|error| error.to_string())
    }
}

impl Equations {
    fn filters(&self, parameters: &[&str]) -> Result<Vec<Filter>, String> {
        let filter = |saved: &SavedFilter| {
            let parameter = parameters.iter().position(|name| *name == saved.parameter);
            Ok(Filter {
                joint: saved.joint,
                kind: saved.kind,
                parameter: parameter.ok_or_else(|| format!("no parameter {}", saved.parameter))?,
            })
        };
        self.filters.iter().map(filter).collect()
    }

    fn internal(&self, parameters: &[&str]) -> Option<InternalStates> {
        let names: Vec<String> = self.states.iter().map(|state| state.name.clone()).collect();
        let starts: Vec<f64> = self.states.iter().map(|state| state.start).collect();
        let parameters = parameters.iter().copied();
        (!names.is_empty()).then(|| InternalStates::at_rest(names, &starts, parameters))
    }

    fn program(&self) -> Result<Program, String> {
        let mut graph = Graph::new();
        let inputs: Vec<Node> = self.inputs.iter().map(|name| graph.input(name)).collect();
        let mut nodes = Vec::new();
        for operation in &self.operations {
            let node = write(&mut graph, &inputs, &nodes, operation);
            nodes.push(node.ok_or_else(|| format!("{operation} is not an operation"))?);
        }
        let outputs = self.outputs.iter().map(|k| nodes.get(*k).copied());
        let outputs: Option<Vec<Node>> = outputs.collect();
        Ok(graph.finish(&outputs.ok_or("an output is not an operation")?))
    }
}

/// An operation on earlier nodes, if it is one.
fn write(graph: &mut Graph, inputs: &[Node], nodes: &[Node], operation: &Value) -> Option<Node> {
    let at = |k: usize| nodes.get(index(operation, k)?).copied();
    match operation[0].as_str()? {
        "input" => inputs.get(index(operation, 1)?).copied(),
        "const" => Some(graph.constant(operation[1].as_f64()?)),
        "where" => Some(graph.select(at(1)?, at(2)?, at(3)?)),
        _ => match function(operation) {
            Some(unary) => Some(graph.unary(unary, at(1)?)),
            None => Some(graph.binary(function(operation)?, at(1)?, at(2)?)),
        },
    }
}

fn index(operation: &Value, k: usize) -> Option<usize> {
    usize::try_from(operation[k].as_u64()?).ok()
}

fn function<F: DeserializeOwned>(operation: &Value) -> Option<F> {
    serde_json::from_value(operation[0].clone()).ok()
}
