use super::op::Op;
use super::{Node, Program};

/// The number types that programs run on: f64 to fit, f32 to train and plan.
pub trait Real:
    num_traits::Float + num_traits::FromPrimitive + Default + Send + Sync + 'static
{
}

impl Real for f32 {}
impl Real for f64 {}

/// The working memory of one program, `W` independent evaluations side by side. One lane is the plain
/// evaluator; many lanes let the compiler use the processor's vector registers and spread the cost of
/// reading the program.
#[derive(Debug, Clone)]
pub struct Tape<'p, T, const W: usize> {
    program: &'p Program,
    first_step: usize,
    values: Vec<[T; W]>,
}

impl Program {
    /// Working memory for this program with the constants in place and all inputs zero.
    pub fn tape<T: Real, const W: usize>(&self) -> Tape<'_, T, W> {
        let constant = |op: &Op| match op {
            Op::Const(value) => T::from_f64(*value).expect("every f64 has a nearest float"),
            _ => T::zero(),
        };
        Tape {
            program: self,
            first_step: self
                .ops
                .iter()
                .position(|op| !matches!(op, Op::Input(_) | Op::Const(_)))
                .unwrap_or(self.ops.len()),
            values: self.ops.iter().map(|op| [constant(op); W]).collect(),
        }
    }

    /// Evaluate once in f64. For repeated evaluation keep a [`Tape`].
    ///
    /// # Panics
    /// When `inputs` is not as long as [`Program::inputs`].
    pub fn eval(&self, inputs: &[f64]) -> Vec<f64> {
        assert_eq!(inputs.len(), self.inputs.len(), "one value for each input");
        let mut tape = self.tape::<f64, 1>();
        for (slot, value) in tape.inputs().iter_mut().zip(inputs) {
            *slot = [*value];
        }
        tape.run();
        (0..self.outputs.len()).map(|k| tape.output(k)[0]).collect()
    }
}

impl<T: Real, const W: usize> Tape<'_, T, W> {
    /// The inputs, to be set before [`Tape::run`]: `[input][lane]`.
    pub fn inputs(&mut self) -> &mut [[T; W]] {
        &mut self.values[..self.program.inputs.len()]
    }

    /// The k-th output of the last run.
    pub fn output(&self, k: usize) -> &[T; W] {
        &self.values[self.program.outputs[k].index()]
    }

    /// Carry out every operation on every lane.
    pub fn run(&mut self) {
        for index in self.first_step..self.values.len() {
            let (earlier, now) = self.values.split_at_mut(index);
            let at = |node: Node| &earlier[node.index()];
            let out = &mut now[0];
            match self.program.ops[index] {
                Op::Const(_) | Op::Input(_) => unreachable!("inputs and constants come first"),
                Op::Unary(op, a) => unary(op, at(a), out),
                Op::Binary(op, a, b) => binary(op, at(a), at(b), out),
                Op::Where(c, a, b) => {
                    let (c, a, b) = (at(c), at(a), at(b));
                    for lane in 0..W {
                        out[lane] = if c[lane] > T::zero() {
                            a[lane]
                        } else {
                            b[lane]
                        };
                    }
                }
            }
        }
    }
}

// The operation is matched outside of the loop over lanes: each arm becomes a loop of one instruction.
macro_rules! lanes {
    ($op:expr, $($variant:path),+ => |$lane:ident, $chosen:ident| $value:expr, $out:expr) => {
        match $op {
            $($variant => {
                let $chosen = $variant;
                for $lane in 0..W { $out[$lane] = $value; }
            })+
        }
    };
}

fn unary<T: Real, const W: usize>(op: super::Unary, a: &[T; W], out: &mut [T; W]) {
    use super::Unary::{Abs, Cos, Exp, Log, Neg, Sign, Sin, Sqrt, Tan, Tanh};
    lanes!(op, Neg, Sin, Cos, Tan, Exp, Log, Sqrt, Abs, Sign, Tanh
        => |lane, chosen| chosen.apply(a[lane]), out);
}

fn binary<T: Real, const W: usize>(op: super::Binary, a: &[T; W], b: &[T; W], out: &mut [T; W]) {
    use super::Binary::{Add, Atan2, Div, Less, Max, Min, Mul, Pow, Sub};
    lanes!(op, Add, Sub, Mul, Div, Pow, Atan2, Min, Max, Less
        => |lane, chosen| chosen.apply(a[lane], b[lane]), out);
}
