use super::Program;
use super::op::Op;
use super::steps::{Kind, Step};
use crate::lanes::{Arch, Element, Row, Simd, Vector, WithSimd};

/// The number types that programs run on: f64 to fit, f32 to train and plan.
pub trait Real:
    num_traits::Float + num_traits::FromPrimitive + Default + Send + Sync + 'static
{
}

impl Real for f32 {}
impl Real for f64 {}

/// The working memory of one program, `W` independent evaluations side by side, in whole registers of the
/// processor at hand where `W` is a multiple of theirs and one after the other elsewhere.
#[derive(Debug, Clone)]
pub struct Tape<'p, T, const W: usize> {
    program: &'p Program,
    /// Those that depend on held inputs alone, then the others.
    steps: Vec<Step>,
    first_moving: usize,
    /// From this input on inputs are held.
    held_from: usize,
    /// Whether the steps of held inputs have been carried out.
    settled: bool,
    values: Vec<Row<T, W>>,
}

impl Program {
    /// Working memory for this program with the constants in place and all inputs zero.
    pub fn tape<T: Element, const W: usize>(&self) -> Tape<'_, T, W> {
        self.tape_with_held(self.inputs.len())
    }

    /// The same where the inputs from `held_from` on change seldom: what depends on them alone is found anew only
    /// after [`Tape::inputs`] was asked for, while [`Tape::moving`] gives the others.
    pub fn tape_with_held<T: Element, const W: usize>(&self, held_from: usize) -> Tape<'_, T, W> {
        let number = |value: f64| T::from_f64(value).expect("every f64 has a nearest float");
        let constant = |op: &Op| match op {
            Op::Const(value) => number(*value),
            _ => T::zero(),
        };
        let of_ops = self.ops.iter().map(constant);
        let more = (self.steps.more.iter()).map(|value| value.map_or(T::zero(), number));
        let is_held = |step: &&Step| step.first_input as usize >= held_from;
        let (mut steps, moving): (Vec<Step>, Vec<Step>) = self.steps.steps.iter().partition(is_held);
        let first_moving = steps.len();
        steps.extend(moving);
        Tape {
            program: self,
            steps,
            first_moving,
            held_from,
            settled: false,
            values: of_ops.chain(more).map(Row::splat).collect(),
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
            *slot = Row([*value]);
        }
        tape.run();
        (0..self.outputs.len()).map(|k| tape.output(k)[0]).collect()
    }
}

impl<T: Element, const W: usize> Tape<'_, T, W> {
    /// The inputs, to be set before [`Tape::run`]: `[input][lane]`.
    #[inline(always)]
    pub fn inputs(&mut self) -> &mut [Row<T, W>] {
        self.settled = false;
        &mut self.values[..self.program.inputs.len()]
    }

    /// The inputs that are not held.
    #[inline(always)]
    pub fn moving(&mut self) -> &mut [Row<T, W>] {
        &mut self.values[..self.held_from]
    }

    /// The k-th output of the last run.
    #[inline(always)]
    pub fn output(&self, k: usize) -> &Row<T, W> {
        &self.values[self.program.outputs[k].index()]
    }

    /// Carry out every operation on every lane.
    pub fn run(&mut self) {
        Arch::new().dispatch(Run(self));
    }

    /// The same within a function that is on these instructions already.
    #[inline(always)]
    pub fn run_on<S: Simd>(&mut self, simd: S) {
        if W.is_multiple_of(T::lanes::<S>()) {
            self.carry_out(simd);
        } else {
            self.carry_out(pulp::Scalar);
        }
    }

    #[inline(always)]
    fn carry_out<S: Simd>(&mut self, simd: S) {
        let first = if self.settled { self.first_moving } else { 0 };
        self.settled = true;
        let mut values = Values {
            simd,
            rows: &mut self.values,
        };
        for step in &self.steps[first..] {
            values.carry_out(step);
        }
    }
}

struct Run<'t, 'p, T, const W: usize>(&'t mut Tape<'p, T, W>);

impl<T: Element, const W: usize> WithSimd for Run<'_, '_, T, W> {
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

impl<S: Simd, T: Element, const W: usize> Values<'_, S, T, W> {
    #[inline(always)]
    fn carry_out(&mut self, step: &Step) {
        type V<S, T> = Vector<S, T>;
        match step.kind {
            Kind::Neg => self.unary(step, |a| -a),
            Kind::Sin => self.unary(step, V::sin),
            Kind::Cos => self.unary(step, V::cos),
            Kind::SinCos => self.sin_cos(step),
            Kind::Tan => self.unary(step, V::tan),
            Kind::Exp => self.unary(step, V::exp),
            Kind::Log => self.unary(step, V::ln),
            Kind::Sqrt => self.unary(step, V::sqrt),
            Kind::Abs => self.unary(step, V::abs),
            Kind::Sign => self.unary(step, sign),
            Kind::Tanh => self.unary(step, V::tanh),
            Kind::Reciprocal => self.unary(step, |a| a.like(1.0) / a),
            Kind::Add => self.binary(step, |a, b| a + b),
            Kind::Sub => self.binary(step, |a, b| a - b),
            Kind::Mul => self.binary(step, |a, b| a * b),
            Kind::Div => self.binary(step, |a, b| a / b),
            Kind::Pow => self.binary(step, V::pow),
            Kind::Atan2 => self.binary(step, V::atan2),
            // What is not a number spreads instead of vanishing.
            Kind::Min => self.binary(step, |a, b| a.if_less(b, a, a.if_equal(a, b, a))),
            Kind::Max => self.binary(step, |a, b| b.if_less(a, a, a.if_equal(a, b, a))),
            Kind::Less => self.binary(step, |a, b| a.if_less(b, a.like(1.0), a.like(0.0))),
            Kind::Where => self.ternary(step, |a, b, c| c.like(0.0).if_less(c, a, b)),
            Kind::MulAdd => self.ternary(step, V::mul_add),
            Kind::MulSub => self.ternary(step, |a, b, c| a.mul_add(b, -c)),
            Kind::SubMul => self.ternary(step, |a, b, c| (-a).mul_add(b, c)),
        }
    }

    #[inline(always)]
    fn unary(&mut self, step: &Step, function: impl Fn(Vector<S, T>) -> Vector<S, T>) {
        for part in 0..Self::parts() {
            let value = function(self.get(step.a, part));
            self.set(step.to, part, value);
        }
    }

    #[inline(always)]
    fn binary(
        &mut self,
        step: &Step,
        function: impl Fn(Vector<S, T>, Vector<S, T>) -> Vector<S, T>,
    ) {
        for part in 0..Self::parts() {
            let value = function(self.get(step.a, part), self.get(step.b, part));
            self.set(step.to, part, value);
        }
    }

    #[inline(always)]
    fn ternary(
        &mut self,
        step: &Step,
        function: impl Fn(Vector<S, T>, Vector<S, T>, Vector<S, T>) -> Vector<S, T>,
    ) {
        for part in 0..Self::parts() {
            let [a, b, c] = [step.a, step.b, step.c].map(|place| self.get(place, part));
            self.set(step.to, part, function(a, b, c));
        }
    }

    #[inline(always)]
    fn sin_cos(&mut self, step: &Step) {
        for part in 0..Self::parts() {
            let (sine, cosine) = self.get(step.a, part).sin_cos();
            self.set(step.to, part, sine);
            self.set(step.b, part, cosine);
        }
    }

    /// Registers of one value.
    #[inline(always)]
    fn parts() -> usize {
        W / T::lanes::<S>()
    }

    #[inline(always)]
    fn get(&self, place: u32, part: usize) -> Vector<S, T> {
        let registers = T::registers::<S>(&self.rows[place as usize].0);
        Vector::new(self.simd, registers[part])
    }

    #[inline(always)]
    fn set(&mut self, place: u32, part: usize, value: Vector<S, T>) {
        let registers = T::registers_mut::<S>(&mut self.rows[place as usize].0);
        registers[part] = value.register;
    }
}

/// -1, 0 or 1.
#[inline(always)]
fn sign<S: Simd, T: Element>(a: Vector<S, T>) -> Vector<S, T> {
    let zero = a.like(0.0);
    let not_positive = a.if_less(zero, a.like(-1.0), a * zero);
    zero.if_less(a, a.like(1.0), not_positive)
}
