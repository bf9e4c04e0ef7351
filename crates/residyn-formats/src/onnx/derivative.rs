//! ds/dt as operators: equations work on columns, networks on matrices.

use super::builder::{Builder, Value, whole};
use super::proto::FLOAT;
use crate::ExportModel;
use residyn_core::expr::{Binary, Op, Unary};
use residyn_core::model::{Angles, MlpWeights};

/// The right-hand side, written once for each evaluation by the integrator.
pub struct Derivative<'m> {
    model: &'m ExportModel,
    parameters: Vec<Value>,
}

/// When the rates are wanted: columns of the state and of the torque that acts, and the time.
pub struct Moment<'v> {
    pub state: &'v [Value],
    pub torque: &'v [Value],
    pub time: Option<&'v Value>,
    /// The state in which the step began, and the step's length, over which the rates of effects' states are means.
    pub begun: &'v [Value],
    pub length_s: f64,
}

impl<'m> Derivative<'m> {
    /// Writes the parameters as named numbers.
    pub fn new(builder: &mut Builder, model: &'m ExportModel) -> Self {
        let parameters = model.equations.parameters.iter();
        let parameters = parameters
            .map(|p| builder.parameter(&format!("parameters.{}", p.name), p.value, &p.unit))
            .collect();
        Self { model, parameters }
    }

    /// The rates: one column each.
    pub fn write(&self, builder: &mut Builder, at: &Moment<'_>) -> Vec<Value> {
        let Moment { state, torque, .. } = at;
        let layout = self.model.equations.layout();
        let mut inputs: Vec<Value> = state.iter().chain(*torque).cloned().collect();
        let time = at.time.cloned();
        inputs.push(time.unwrap_or_else(|| builder.constant(0.0)));
        if !layout.internal().is_empty() {
            inputs.extend_from_slice(&at.begun[layout.internal()]);
            inputs.push(builder.constant(at.length_s));
        }
        inputs.extend_from_slice(&self.parameters);
        let mut rates = self.equations(builder, &inputs);
        let motion = &state[..layout.internal().start];
        for (prefix, network) in self.model.prefixed() {
            let parts = write_network(builder, network, prefix, motion, torque);
            let first = motion.len() - parts.len();
            for (rate, part) in rates[first..].iter_mut().zip(&parts) {
                *rate = builder.apply("Add", &[rate, part]);
            }
        }
        rates
    }

    fn equations(&self, builder: &mut Builder, inputs: &[Value]) -> Vec<Value> {
        let program = &self.model.equations.program;
        let mut values: Vec<Value> = Vec::with_capacity(program.ops().len());
        for op in program.ops() {
            let at = |node: residyn_core::expr::Node| &values[node.index()];
            let value = match *op {
                Op::Const(value) => builder.constant(value),
                Op::Input(k) => inputs[k as usize].clone(),
                Op::Unary(f, a) => builder.apply(unary(f), &[at(a)]),
                Op::Binary(f, a, b) => binary(builder, f, at(a), at(b)),
                Op::Where(c, a, b) => {
                    let zero = builder.constant(0.0);
                    let condition = builder.apply("Greater", &[at(c), &zero]);
                    builder.apply("Where", &[&condition, at(a), at(b)])
                }
            };
            values.push(value);
        }
        let outputs = program.outputs().iter();
        outputs.map(|node| values[node.index()].clone()).collect()
    }
}

fn unary(function: Unary) -> &'static str {
    match function {
        Unary::Neg => "Neg",
        Unary::Sin => "Sin",
        Unary::Cos => "Cos",
        Unary::Tan => "Tan",
        Unary::Exp => "Exp",
        Unary::Log => "Log",
        Unary::Sqrt => "Sqrt",
        Unary::Abs => "Abs",
        Unary::Sign => "Sign",
        Unary::Tanh => "Tanh",
    }
}

fn binary(builder: &mut Builder, function: Binary, a: &Value, b: &Value) -> Value {
    let operator = match function {
        Binary::Add => "Add",
        Binary::Sub => "Sub",
        Binary::Mul => "Mul",
        Binary::Div => "Div",
        Binary::Pow => "Pow",
        Binary::Min => "Min",
        Binary::Max => "Max",
        Binary::Less => {
            let less = builder.apply("Less", &[a, b]);
            return builder.apply_with("Cast", &[&less], vec![whole("to", FLOAT.into())]);
        }
        Binary::Atan2 => return atan2(builder, a, b),
    };
    builder.apply(operator, &[a, b])
}

/// ONNX has only atan: for negative `x`, half a turn with the sign of `y` is added.
fn atan2(builder: &mut Builder, y: &Value, x: &Value) -> Value {
    let half = std::f64::consts::PI;
    let [zero, up, down] = [0.0, half, -half].map(|value| builder.constant(value));
    let slope = builder.apply("Div", &[y, x]);
    let angle = builder.apply("Atan", &[&slope]);
    // On the x axis, where the slope may be 0 / 0.
    let level = builder.apply("Equal", &[y, &zero]);
    let angle = builder.apply("Where", &[&level, &zero, &angle]);
    let (below, left) = (
        builder.apply("Less", &[y, &zero]),
        builder.apply("Less", &[x, &zero]),
    );
    let turn = builder.apply("Where", &[&below, &down, &up]);
    let turn = builder.apply("Where", &[&left, &turn, &zero]);
    builder.apply("Add", &[&angle, &turn])
}

/// The network's outputs, one column each. Its tensors have the names of PyTorch's linear layers.
fn write_network(
    builder: &mut Builder,
    network: &MlpWeights,
    prefix: &str,
    state: &[Value],
    torque: &[Value],
) -> Vec<Value> {
    let mut features: Vec<Value> = Vec::new();
    let (q, qd) = state.split_at(torque.len());
    match network.angles {
        Angles::Raw => features.extend_from_slice(q),
        Angles::SinCos => {
            for function in ["Sin", "Cos"] {
                features.extend(q.iter().map(|q| builder.apply(function, &[q])));
            }
        }
    }
    features.extend(qd.iter().chain(torque).cloned());
    let scaling = &network.scaling;
    let count = scaling.mean.len();
    let factors: Vec<f64> = scaling.std.iter().map(|std| 1.0 / std).collect();
    let mean = builder.initializer(&format!("{prefix}mean"), vec![count], &scaling.mean, "");
    let factor = builder.initializer(&format!("{prefix}factor"), vec![count], &factors, "");
    let features = builder.concat(&features, &state[0]);
    let centred = builder.apply("Sub", &[&features, &mean]);
    let mut values = builder.apply("Mul", &[&centred, &factor]);
    for (k, layer) in network.layers.iter().enumerate() {
        let name = |part: &str| format!("{prefix}layers.{k}.{part}");
        let shape = vec![layer.outputs, layer.inputs];
        let weight = builder.initializer(&name("weight"), shape, &layer.weight, "");
        let bias = builder.initializer(&name("bias"), vec![layer.outputs], &layer.bias, "");
        let transposed = vec![whole("transB", 1)];
        values = builder.apply_with("Gemm", &[&values, &weight, &bias], transposed);
        if k + 1 < network.layers.len() {
            values = builder.apply("Relu", &[&values]);
        }
    }
    builder.split(&values, network.on.outputs(torque.len()))
}
