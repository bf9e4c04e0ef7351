use burn::tensor::{Bool, Device, Tensor};

use residyn_core::expr::{Binary, Node, Op, Program, Unary};

/// A value of a replay: constants stay numbers until they are combined with a tensor.
#[derive(Clone)]
enum Value {
    Number(f64),
    Column(Tensor<1>),
}

/// Evaluates a program on Burn tensors, one row of the batch in each entry, with Burn's derivatives and on its devices.
/// `inputs` have the shape `[batch]`, or `[1]` for values that all rows share; so do the outputs.
///
/// # Panics
/// When `inputs` is empty or not as long as [`Program::inputs`].
pub fn replay(program: &Program, inputs: &[Tensor<1>]) -> Vec<Tensor<1>> {
    assert_eq!(
        inputs.len(),
        program.inputs().len(),
        "one tensor for each input"
    );
    let device = inputs[0].device();
    let mut values: Vec<Value> = Vec::with_capacity(program.ops().len());
    for op in program.ops() {
        let at = |node: Node| values[node.index()].clone();
        let column = |node: Node| at(node).column(&device);
        let value = match *op {
            Op::Const(value) => Value::Number(value),
            Op::Input(k) => Value::Column(inputs[k as usize].clone()),
            Op::Unary(op, a) => Value::Column(unary(op, column(a))),
            Op::Binary(op, a, b) => Value::Column(binary(op, at(a), at(b), &device)),
            Op::Where(c, a, b) => {
                Value::Column(select(column(c).greater_elem(0.0), column(a), column(b)))
            }
        };
        values.push(value);
    }
    let outputs = program.outputs().iter();
    outputs
        .map(|output| values[output.index()].clone().column(&device))
        .collect()
}

impl Value {
    fn column(self, device: &Device) -> Tensor<1> {
        match self {
            Self::Column(tensor) => tensor,
            #[allow(clippy::cast_possible_truncation)] // training runs in f32
            Self::Number(value) => Tensor::from_floats([value as f32], device),
        }
    }
}

fn unary(op: Unary, a: Tensor<1>) -> Tensor<1> {
    match op {
        Unary::Neg => a.neg(),
        Unary::Sin => a.sin(),
        Unary::Cos => a.cos(),
        Unary::Tan => a.tan(),
        Unary::Exp => a.exp(),
        Unary::Log => a.log(),
        Unary::Sqrt => a.sqrt(),
        Unary::Abs => a.abs(),
        Unary::Sign => a.sign(),
        Unary::Tanh => a.tanh(),
    }
}

fn binary(op: Binary, a: Value, b: Value, device: &Device) -> Tensor<1> {
    match (op, a, b) {
        (Binary::Add, Value::Column(a), Value::Number(b)) => a + b,
        (Binary::Add, Value::Number(a), Value::Column(b)) => b + a,
        (Binary::Sub, Value::Column(a), Value::Number(b)) => a - b,
        (Binary::Mul, Value::Column(a), Value::Number(b)) => a * b,
        (Binary::Mul, Value::Number(a), Value::Column(b)) => b * a,
        (Binary::Div, Value::Column(a), Value::Number(b)) => a / b,
        (Binary::Pow, Value::Column(a), Value::Number(b)) => a.powf_scalar(b),
        (op, a, b) => columns(op, a.column(device), b.column(device)),
    }
}

fn columns(op: Binary, a: Tensor<1>, b: Tensor<1>) -> Tensor<1> {
    match op {
        Binary::Add => a + b,
        Binary::Sub => a - b,
        Binary::Mul => a * b,
        Binary::Div => a / b,
        Binary::Pow => a.powf(b),
        Binary::Atan2 => a.atan2(b),
        // As in scalar evaluation: NaN propagates.
        Binary::Min => {
            let (a, b) = same_shape(a, b);
            let first = a.clone().lower(b.clone()).bool_or(a.clone().is_nan());
            select(first, a, b)
        }
        Binary::Max => {
            let (a, b) = same_shape(a, b);
            let first = a.clone().greater(b.clone()).bool_or(a.clone().is_nan());
            select(first, a, b)
        }
        Binary::Less => {
            let (a, b) = same_shape(a, b);
            a.lower(b).float()
        }
    }
}

/// `a` where `condition` holds, else `b`.
fn select(condition: Tensor<1, Bool>, a: Tensor<1>, b: Tensor<1>) -> Tensor<1> {
    let rows = condition.dims()[0].max(a.dims()[0]).max(b.dims()[0]);
    let [a, b] = [a, b].map(|t| t.expand([rows]));
    b.mask_where(condition.expand([rows]), a)
}

fn same_shape(a: Tensor<1>, b: Tensor<1>) -> (Tensor<1>, Tensor<1>) {
    let rows = a.dims()[0].max(b.dims()[0]);
    (a.expand([rows]), b.expand([rows]))
}
