//! ONNX: the whole step as a graph, and the derivative as a second graph in a separate file. Rows of a batch are
//! independent; everything is in single precision.

mod builder;
mod derivative;
mod proto;
mod step;

use std::path::Path;

use prost::Message;
use serde_json::json;

use super::discrete_filter::DiscreteFilter;
use super::verify::{Client, PythonClient};
use super::{ExportError, ExportModel, File, Format};
use builder::Builder;
use derivative::{Derivative, Moment};
use proto::{Graph, Model, OperatorSet, Property};
use residyn_core::data::Joint;
use residyn_core::expr::Op;

pub(super) const FORMAT: Format = Format {
    name: "onnx",
    about: "a step and the derivative, as two single-precision graphs with a free batch dimension",
    extension: "onnx",
    not_carried,
    files,
    client: Client::Python(PythonClient {
        name: "onnx.py",
        script: include_str!("../../../../docs/clients/onnx.py"),
        packages: "numpy onnxruntime",
    }),
    tolerance: 1e-5,
    robots: None,
};

/// Versions that every runtime of recent years reads.
const IR_VERSION: i64 = 8;
const OPERATOR_SET: i64 = 17;

fn not_carried(model: &ExportModel) -> Vec<String> {
    let mut lost = vec!["double precision: all numbers are single".to_owned()];
    if !DiscreteFilter::all(model).is_empty() {
        let step = model.step_s;
        lost.push(format!(
            "steps other than {step} s: delay and lag are written for it; their memory is an input and an output"
        ));
    }
    lost.extend(model.sensors_not_carried());
    lost
}

/// Refuse numbers that single precision cannot represent.
fn check_single(model: &ExportModel) -> Result<(), ExportError> {
    let constant = |op: &Op| match op {
        Op::Const(value) => Some(*value),
        _ => None,
    };
    let constants = model.equations.program.ops().iter().filter_map(constant);
    let mut numbers = constants.chain(model.equations.values());
    match numbers.find(|number| number.abs() > f64::from(f32::MAX)) {
        Some(number) => Err(model.refused(
            FORMAT.name,
            format!("{number:e} is beyond single precision"),
        )),
        None => Ok(()),
    }
}

fn files(model: &ExportModel, path: &Path) -> Result<Vec<File>, ExportError> {
    check_single(model)?;
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push("-derivative.");
    name.push(path.extension().unwrap_or("onnx".as_ref()));
    let derivative = path.with_file_name(name);
    let file = |path: &Path, graph: Graph, about| File::new(path, packed(model, graph), about);
    let step = match DiscreteFilter::all(model).is_empty() {
        true => "state, torque -> next_state",
        false => "state, torque, memory -> next_state, next_memory",
    };
    let rates = "state, torque -> derivative";
    Ok(vec![
        file(path, step::graph(model), step),
        file(&derivative, derivative_graph(model), rates),
    ])
}

fn derivative_graph(model: &ExportModel) -> Graph {
    let mut builder = Builder::default();
    let inputs = step::inputs(&mut builder, model, "torque that acts");
    let derivative = Derivative::new(&mut builder, model);
    let at = Moment {
        state: &inputs.state,
        torque: &inputs.torque,
        time: inputs.time.as_ref(),
        begun: &inputs.state,
        length_s: 0.0,
    };
    let rates = derivative.write(&mut builder, &at);
    let derivative = builder.concat(&rates, &inputs.state[0]);
    builder.output(
        "derivative",
        &derivative,
        model.states(),
        "velocities, then accelerations, then rates of the states of effects",
    );
    builder.finish("derivative")
}

fn packed(model: &ExportModel, graph: Graph) -> Vec<u8> {
    let text = |key: &str, value: String| Property {
        key: key.to_owned(),
        value,
    };
    let parameters: Vec<_> = (model.equations.parameters.iter())
        .map(|p| json!({"name": p.name, "value": p.value, "unit": p.unit, "ci95": p.ci95}))
        .collect();
    let units: Vec<_> = Joint::all(model.joints())
        .map(|joint| model.units(joint))
        .collect();
    let memory: Vec<_> = (DiscreteFilter::all(model).iter())
        .map(|f| json!({"joint": f.joint, "past_torques": f.past, "lagged_torque": f.lags}))
        .collect();
    let json = |value: serde_json::Value| value.to_string();
    let message = Model {
        ir_version: IR_VERSION,
        producer_name: "residyn".to_owned(),
        producer_version: env!("CARGO_PKG_VERSION").to_owned(),
        doc_string: model.system.about.clone(),
        graph: Some(graph),
        opset_import: vec![OperatorSet {
            domain: String::new(),
            version: OPERATOR_SET,
        }],
        metadata_props: vec![
            text("system", model.name().to_owned()),
            text("joints", model.joints().to_string()),
            text("dt", model.step_s.to_string()),
            text("integrator", model.integrator.to_string()),
            text("units", json(json!(units))),
            text("parameters", json(json!(parameters))),
            text("effects", json(json!(model.effects))),
            text("memory", json(json!(memory))),
            text("rest", json(json!(model.rest()))),
            text("origin", json(model.origin.clone())),
        ],
    };
    message.encode_to_vec()
}
