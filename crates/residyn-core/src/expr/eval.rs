use super::Program;
use super::op::{Binary, Op, Unary};
use super::places::Places;
use super::steps::{Kind, Step};
use crate::lanes::{Element, Row, Simd, Vector, WithSimd};

#[cfg(test)]
mod tests;

/// Working memory for `W` independent evaluations of one program, vectorised if `W` is a multiple of the processor's
/// vector length.
#[derive(Debug, Clone)]
pub struct Tape<T, const W: usize> {
    inputs: usize,
    /// Steps that depend only on held inputs.
    held: Runs,
    /// All other steps.
    moving: Runs,
    /// Index of the first held input.
    held_from: usize,
    /// Whether the steps of the held inputs are up to date.
    settled: bool,
    values: Vec<Row<T, W>>,
    /// Index of each output among the values.
    outputs: Vec<u32>,
}

/// Steps, and how many consecutive ones are of one kind.
#[derive(Debug, Clone)]
struct Runs {
    steps: Vec<Step>,
    runs: Vec<(Kind, usize)>,
}

impl Runs {
    fn new(steps: Vec<Step>) -> Self {
        let of_one_kind = steps.chunk_by(|a, b| a.kind == b.kind);
        let runs = of_one_kind.map(|run| (run[0].kind, run.len())).collect();
        Self { steps, runs }
    }
}

impl Program {
    /// Working memory for this program with the constants in place and all inputs zero.
    pub fn tape<T: Element, const W: usize>(&self) -> Tape<T, W> {
        self.tape_with_held(self.inputs.len())
    }

    /// As [`Program::tape`] when the inputs from `held_from` on change rarely: steps that depend only on them are
    /// evaluated again only after a call of [`Tape::inputs`]; [`Tape::moving`] gives access to the other inputs.
    pub fn tape_with_held<T: Element, const W: usize>(&self, held_from: usize) -> Tape<T, W> {
        let is_held = |step: &&Step| step.first_input as usize >= held_from;
        let (mut held, mut moving): (Vec<Step>, Vec<Step>) =
            self.steps.steps.iter().partition(is_held);
        let of_ops = self.ops.iter().map(|op| match op {
            Op::Const(value) => Some(*value),
            _ => None,
        });
        let all = of_ops.chain(self.steps.more.iter().copied()).enumerate();
        let constants: Vec<(usize, f64)> = all.filter_map(|(k, value)| Some((k, value?))).collect();
        let count = self.ops.len() + self.steps.more.len();
        let mut places = Places::new(count, self.inputs.len());
        let kept = constants.iter().map(|(value, _)| *value);
        let kept = kept.chain(self.outputs.iter().map(|output| output.index()));
        kept.for_each(|value| places.keep(value));
        places.settle(&mut held);
        places.pass(&mut moving);
        let place = |value: usize| places.of[value] as usize;
        let mut values = vec![Row::splat(T::zero()); places.count as usize];
        for (value, number) in constants {
            values[place(value)] =
                Row::splat(T::from_f64(number).expect("every f64 has a nearest float"));
        }
        let outputs = self.outputs.iter();
        let outputs = outputs.map(|output| places.of[output.index()]).collect();
        Tape {
            inputs: self.inputs.len(),
            held: Runs::new(held),
            moving: Runs::new(moving),
            held_from,
            settled: false,
            values,
            outputs,
        }
    }

    /// As [`Program::tape_with_held`], with these values of the held inputs in every lane.
    pub fn tape_at<T: Element, const W: usize>(&self, held_from: usize, held: &[T]) -> Tape<T, W> {
        let mut tape = self.tape_with_held(held_from);
        for (slot, value) in tape.inputs()[held_from..].iter_mut().zip(held) {
            *slot = Row::splat(*value);
        }
        tape
    }

    /// Evaluate once in f64. For repeated evaluation keep a [`Tape`].
    ///
    /// # Panics
    /// When `inputs` is not as long as [`Program::inputs`].
    pub fn eval(&self, inputs: &[f64]) -> Vec<f64> {
        assert_eq!(inputs.len(), self.inputs.len(), "one value for each input");
        let mut tape = self.tape_at::<f64, 1>(0, inputs);
        tape.run();
        (0..self.outputs.len()).map(|k| tape.output(k)[0]).collect()
    }
}

impl<T: Element, const W: usize> Tape<T, W> {
    /// The inputs, to be set before [`Tape::run`]: `[input][lane]`.
    #[inline(always)]
    pub fn inputs(&mut self) -> &mut [Row<T, W>] {
        self.settled = false;
        &mut self.values[..self.inputs]
    }

    /// The inputs that are not held.
    #[inline(always)]
    pub fn moving(&mut self) -> &mut [Row<T, W>] {
        &mut self.values[..self.held_from]
    }

    /// The k-th output of the last run.
    #[inline(always)]
    pub fn output(&self, k: usize) -> &Row<T, W> {
        &self.values[self.outputs[k] as usize]
    }

    /// Evaluate the program in every lane.
    pub fn run(&mut self) {
        Row::<T, W>::dispatch(CarryOut(self));
    }

    /// [`Tape::run`] from within code that is compiled for these vector instructions already.
    #[inline(always)]
    pub fn run_on<S: Simd>(&mut self, simd: S) {
        if Row::<T, W>::fills::<S>() {
            self.carry_out(simd);
        } else {
            self.carry_out(pulp::Scalar);
        }
    }

    #[inline(always)]
    fn carry_out<S: Simd>(&mut self, simd: S) {
        let mut values = Values {
            simd,
            rows: &mut self.values,
        };
        let first = usize::from(self.settled);
        for part in &[&self.held, &self.moving][first..] {
            let mut left = part.steps.as_slice();
            for (kind, count) in &part.runs {
                let (steps, rest) = left.split_at(*count);
                values.carry_out(*kind, steps);
                left = rest;
            }
        }
        self.settled = true;
    }
}

struct CarryOut<'t, T, const W: usize>(&'t mut Tape<T, W>);

impl<T: Element, const W: usize> WithSimd for CarryOut<'_, T, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.0.run_on(simd);
    }
}

struct Values<'v, S, T, const W: usize> {
    simd: S,
    rows: &'v mut [Row<T, W>],
}

// A macro, not closures: a closure may become a function of its own, compiled without the vector instructions.
macro_rules! each {
    ($values:ident, $steps:ident, |$($operand:ident),*| $value:expr) => {
        for &step in $steps {
            for part in 0..Row::<T, W>::parts::<S>() {
                $(let $operand = $values.get(step.$operand, part);)*
                $values.set(step.to, part, $value);
            }
        }
    };
}

impl<S: Simd, T: Element, const W: usize> Values<'_, S, T, W> {
    #[inline(always)]
    fn carry_out(&mut self, kind: Kind, steps: &[Step]) {
        match kind {
            Kind::Unary(op) => self.unary(op, steps),
            Kind::Binary(op) => self.binary(op, steps),
            Kind::SinCos => {
                for &step in steps {
                    for part in 0..Row::<T, W>::parts::<S>() {
                        let (sine, cosine) = self.get(step.a, part).sin_cos();
                        self.set(step.to, part, sine);
                        self.set(step.b, part, cosine);
                    }
                }
            }
            Kind::Reciprocal => each!(self, steps, |a| a.like(1.0) / a),
            Kind::Where => each!(self, steps, |a, b, c| c.like(0.0).if_less(c, a, b)),
            Kind::MulAdd => each!(self, steps, |a, b, c| a.mul_add(b, c)),
            Kind::MulSub => each!(self, steps, |a, b, c| a.mul_add(b, -c)),
            Kind::SubMul => each!(self, steps, |a, b, c| (-a).mul_add(b, c)),
        }
    }

    #[inline(always)]
    fn unary(&mut self, op: Unary, steps: &[Step]) {
        match op {
            Unary::Neg => each!(self, steps, |a| -a),
            Unary::Sin => each!(self, steps, |a| a.sin()),
            Unary::Cos => each!(self, steps, |a| a.cos()),
            Unary::Tan => each!(self, steps, |a| a.tan()),
            Unary::Exp => each!(self, steps, |a| a.exp()),
            Unary::Log => each!(self, steps, |a| a.ln()),
            Unary::Sqrt => each!(self, steps, |a| a.sqrt()),
            Unary::Abs => each!(self, steps, |a| a.abs()),
            Unary::Sign => each!(self, steps, |a| a.sign()),
            Unary::Tanh => each!(self, steps, |a| a.tanh()),
        }
    }

    #[inline(always)]
    fn binary(&mut self, op: Binary, steps: &[Step]) {
        match op {
            Binary::Add => each!(self, steps, |a, b| a + b),
            Binary::Sub => each!(self, steps, |a, b| a - b),
            Binary::Mul => each!(self, steps, |a, b| a * b),
            Binary::Div => each!(self, steps, |a, b| a / b),
            Binary::Pow => each!(self, steps, |a, b| a.pow(b)),
            Binary::Atan2 => each!(self, steps, |a, b| a.atan2(b)),
            // NaN propagates.
            Binary::Min => each!(self, steps, |a, b| a.if_less(b, a, a.if_equal(a, b, a))),
            Binary::Max => each!(self, steps, |a, b| b.if_less(a, a, a.if_equal(a, b, a))),
            Binary::Less => each!(self, steps, |a, b| a.if_less(b, a.like(1.0), a.like(0.0))),
        }
    }

    #[inline(always)]
    fn get(&self, place: u32, part: usize) -> Vector<S, T> {
        self.rows[place as usize].get(self.simd, part)
    }

    #[inline(always)]
    fn set(&mut self, place: u32, part: usize, value: Vector<S, T>) {
        self.rows[place as usize].set(part, value);
    }
}
