use super::Names;
use crate::ExportModel;
use residyn_core::expr::Notation;
use residyn_core::model::{Angles, MlpWeights};

/// The networks as tables of numbers, with the functions that evaluate them.
pub(super) fn tables(model: &ExportModel, names: &Names) -> String {
    let networks: Vec<String> = model
        .networks()
        .map(|(name, network)| table(model.joints(), name, network, names))
        .collect();
    match networks.is_empty() {
        true => String::new(),
        false => include_str!("layers.h").to_owned() + &networks.concat(),
    }
}

/// Code that adds the networks' outputs to the rates.
pub(super) fn added(model: &ExportModel) -> String {
    each(model, include_str!("network_added.h"))
}

/// Code that adds the networks' derivatives to those of the rates.
pub(super) fn jacobian_added(model: &ExportModel) -> String {
    each(model, include_str!("network_jacobian_added.h"))
}

fn each(model: &ExportModel, template: &str) -> String {
    let filled = |(name, network): (&str, &MlpWeights)| {
        let outputs = network.on.outputs(model.joints());
        template
            .replace("NETWORK", name)
            .replace("OUTPUTS", &outputs.to_string())
    };
    model.networks().map(filled).collect()
}

fn table(joints: usize, name: &str, network: &MlpWeights, names: &Names) -> String {
    let (features, outputs) = (network.angles.features(joints), network.on.outputs(joints));
    let width = network.widths().into_iter().max().unwrap_or(features);
    let [angles, linear] = features_of(network.angles);
    let code = include_str!("network.h")
        .replace("ANGLES_LINEAR", linear)
        .replace("ANGLES", angles)
        .replace("LAYERS\n", &layers(network))
        .replace("LINEAR\n", &linear_layers(network))
        .replace("NETWORK", name)
        .replace("VELOCITIES", &(features - 2 * joints).to_string())
        .replace("FEATURES", &features.to_string())
        .replace("OUTPUTS", &outputs.to_string())
        .replace("WIDTH", &width.to_string());
    numbers(name, network, names) + &code
}

/// The features of the positions, and their derivatives.
fn features_of(angles: Angles) -> [&'static str; 2] {
    match angles {
        Angles::Raw => ["x[i] = state[i];", "dx[i * MODEL_COLUMNS + i] = 1;"],
        Angles::SinCos => [
            "x[i] = MODEL_(sin)(state[i]);\n        x[MODEL_JOINTS + i] = MODEL_(cos)(state[i]);",
            "dx[i * MODEL_COLUMNS + i] = MODEL_(cos)(state[i]);\n        \
             dx[(MODEL_JOINTS + i) * MODEL_COLUMNS + i] = -MODEL_(sin)(state[i]);",
        ],
    }
}

fn layers(network: &MlpWeights) -> String {
    let last = network.layers.len() - 1;
    let layer = |k: usize| {
        let [from, to] = buffers("x", k);
        let affine =
            |to: &str| format!("    model_affine({}, {from}, {to});\n", weights(network, k));
        let outputs = network.layers[k].outputs;
        match k == last {
            true => affine("y"),
            false => format!("{}    model_relu({outputs}, {to});\n", affine(&to)),
        }
    };
    (0..=last).map(layer).collect()
}

fn linear_layers(network: &MlpWeights) -> String {
    let last = network.layers.len() - 1;
    let layer = |k: usize| {
        let ([x, y], [dx, dy]) = (buffers("x", k), buffers("dx", k));
        let (inputs, outputs) = (network.layers[k].inputs, network.layers[k].outputs);
        let linear = |to: &str| {
            format!("    model_linear({outputs}, {inputs}, model_NETWORK_weight{k}, {dx}, {to});\n")
        };
        match k == last {
            true => linear("dy"),
            false => format!(
                "    model_affine({}, {x}, {y});\n{}    model_relu({outputs}, {y});\n    \
                 model_relu_linear({outputs}, {y}, {dy});\n",
                weights(network, k),
                linear(&dy)
            ),
        }
    };
    (0..=last).map(layer).collect()
}

/// The buffers that a layer reads from and writes to: two, used alternately.
fn buffers(name: &str, layer: usize) -> [String; 2] {
    [layer % 2, (layer + 1) % 2].map(|place| format!("{name}[{place}]"))
}

fn weights(network: &MlpWeights, k: usize) -> String {
    let layer = &network.layers[k];
    let (inputs, outputs) = (layer.inputs, layer.outputs);
    format!("{outputs}, {inputs}, model_NETWORK_weight{k}, model_NETWORK_bias{k}")
}

/// Weights are single precision in training; scaling is double.
fn numbers(name: &str, network: &MlpWeights, names: &Names) -> String {
    let widths: Vec<String> = network.widths().iter().map(ToString::to_string).collect();
    let mut text = format!(
        "\n/* The {name} network: layers of {} neurons, row after row. */\n",
        widths.join(", ")
    );
    for (k, layer) in network.layers.iter().enumerate() {
        text += &array(
            &format!("float model_{name}_weight{k}"),
            &layer.weight,
            single,
        );
        text += &array(&format!("float model_{name}_bias{k}"), &layer.bias, single);
    }
    let factors: Vec<f64> = network.scaling.std.iter().map(|std| 1.0 / std).collect();
    let real = |value| names.number(value);
    text += &array(
        &format!("model_real model_{name}_mean"),
        &network.scaling.mean,
        real,
    );
    text + &array(&format!("model_real model_{name}_factor"), &factors, real)
}

fn array(what: &str, values: &[f64], number: impl Fn(f64) -> String) -> String {
    let numbers: Vec<String> = values.iter().map(|value| number(*value)).collect();
    let lines: Vec<String> = numbers
        .chunks(8)
        .map(|line| format!("    {}", line.join(", ")))
        .collect();
    format!(
        "static const {what}[{}] = {{\n{}\n}};\n",
        values.len(),
        lines.join(",\n")
    )
}

#[allow(clippy::cast_possible_truncation)] // every weight is a float
fn single(weight: f64) -> String {
    format!("{:?}f", weight as f32)
}
