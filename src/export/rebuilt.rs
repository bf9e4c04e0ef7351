//! A model rebuilt from a description and its weights alone, as a reader does who knows neither model files nor effects.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::prediction::Prediction;
use super::{Answers, Samples, Unread};
use crate::expr::{Graph, Node, Program};
use crate::model::weights::from_bytes;
use crate::model::{
    CommandFilter, Dynamics, Filter, Integrator, ModelShape, ModelWeights, with_residual,
};

/// What such a reader looks at.
#[derive(Deserialize)]
struct Rebuilt {
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
    operations: Vec<Value>,
    outputs: Vec<usize>,
}

#[derive(Deserialize)]
struct SavedFilter {
    /// Counted from 1.
    joint: usize,
    kind: CommandFilter,
    parameter: String,
}

/// What the model in `path` predicts.
pub(super) fn answers(path: &Path, samples: &Samples) -> Result<Answers, Unread> {
    let refused =
        |error: &dyn std::fmt::Display| Unread::Refused(format!("{}: {error}", path.display()));
    let bytes = std::fs::read(path).map_err(|error| refused(&error))?;
    let model: Rebuilt = serde_json::from_slice(&bytes).map_err(|error| refused(&error))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let weights = folder.join(&model.weights);
    let bytes = std::fs::read(&weights).map_err(|error| refused(&error))?;
    let file = model.weights.to_string_lossy();
    let numbers =
        from_bytes(&model.shape, &bytes, &file, folder).map_err(|error| refused(&error))?;
    let prediction = model
        .prediction(&numbers)
        .map_err(|error| refused(&error))?;
    Ok(prediction.answers(samples))
}

impl Rebuilt {
    fn prediction(self, numbers: &ModelWeights) -> Result<Prediction, String> {
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
            filters: self.equations.filters(&names)?,
            program: self.equations.program()?,
            parameters: values.map(|(p, value)| p.restore(*value)).collect(),
            reading: None,
        };
        let mut networks = numbers.prior.iter().chain(&numbers.residual);
        let whole = networks.try_fold(equations, |dynamics, network| {
            with_residual(&dynamics, network)
        });
        Ok(Prediction {
            whole: whole.map_err(|error| error.to_string())?,
            integrator: self.integrator,
            step_s: self.step_s,
        })
    }
}

impl Equations {
    fn filters(&self, parameters: &[&str]) -> Result<Vec<Filter>, String> {
        let filter = |saved: &SavedFilter| {
            let parameter = parameters.iter().position(|name| *name == saved.parameter);
            let joint = saved.joint.checked_sub(1);
            Ok(Filter {
                joint: joint.ok_or("joints are counted from 1")?,
                kind: saved.kind,
                parameter: parameter.ok_or_else(|| format!("no parameter {}", saved.parameter))?,
            })
        };
        self.filters.iter().map(filter).collect()
    }

    fn program(&self) -> Result<Program, String> {
        let mut graph = Graph::new();
        let inputs: Vec<Node> = self.inputs.iter().map(|name| graph.input(name)).collect();
        let mut nodes = Vec::new();
        for operation in &self.operations {
            let node = write(&mut graph, &inputs, &nodes, operation);
            nodes.push(node.ok_or_else(|| format!("{operation} is no operation"))?);
        }
        let outputs = self.outputs.iter().map(|k| nodes.get(*k).copied());
        let outputs: Option<Vec<Node>> = outputs.collect();
        Ok(graph.finish(&outputs.ok_or("an output is no operation")?))
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
