//! Optimised form of a program for evaluation: fewer and cheaper operations, the same results up to rounding.

use std::collections::{BTreeMap, HashMap, VecDeque};

use super::op::{Binary, Op, Unary};

/// The operation of a [`Step`] on the values at `a`, `b` and `c`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Unary(Unary),
    /// The sine goes to `to`, the cosine to `b`.
    SinCos,
    /// 1 / a
    Reciprocal,
    Binary(Binary),
    /// `a` where `c` is positive, else `b`.
    Where,
    /// a b + c
    MulAdd,
    /// a b - c
    MulSub,
    /// c - a b
    SubMul,
}

const NEGATION: Kind = Kind::Unary(Unary::Neg);
const PRODUCT: Kind = Kind::Binary(Binary::Mul);

/// One operation; operands and results are places. The first places are those of the program's operations, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Step {
    pub kind: Kind,
    pub to: u32,
    pub a: u32,
    pub b: u32,
    pub c: u32,
    /// The lowest index of an input that the result depends on.
    pub first_input: u32,
}

/// The steps of a program, each after the steps whose results it reads.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Steps {
    pub steps: Vec<Step>,
    /// Additional values after those of the program's operations: reciprocals.
    pub more: Vec<Option<f64>>,
}

/// Products and negations that are used only once are fused into sums, the sine and cosine of one angle are computed
/// together, and divisions by the same value share its reciprocal. Steps of one kind are grouped where their
/// dependencies allow it, so that the evaluator branches once for each group.
pub(super) fn steps(ops: &[Op], outputs: impl Iterator<Item = usize>) -> Steps {
    let mut writer = Writer::new(ops, outputs);
    for (place, op) in ops.iter().enumerate() {
        writer.write(place, *op);
    }
    Steps {
        steps: grouped(&writer.steps.into_iter().flatten().collect::<Vec<_>>()),
        more: writer.more,
    }
}

struct Writer<'o> {
    ops: &'o [Op],
    /// How often each operation's value is read, by other operations or as an output.
    uses: Vec<u32>,
    /// How often it is a divisor.
    divides: Vec<u32>,
    /// The operations for the sine and the cosine of an angle.
    waves: HashMap<u32, [Option<usize>; 2]>,
    first_input: Vec<u32>,
    steps: Vec<Option<Step>>,
    /// The index of each operation's step.
    step_of: Vec<Option<usize>>,
    reciprocals: HashMap<u32, u32>,
    more: Vec<Option<f64>>,
}

impl<'o> Writer<'o> {
    fn new(ops: &'o [Op], outputs: impl Iterator<Item = usize>) -> Self {
        let mut uses = vec![0; ops.len()];
        let mut divides = vec![0; ops.len()];
        let mut waves = HashMap::new();
        let mut first_input = Vec::with_capacity(ops.len());
        for output in outputs {
            uses[output] += 1;
        }
        for (place, op) in ops.iter().enumerate() {
            for operand in op.operands() {
                uses[operand.index()] += 1;
            }
            let of_operands = op.operands().map(|operand| first_input[operand.index()]);
            first_input.push(match op {
                Op::Input(k) => *k,
                _ => of_operands.min().unwrap_or(u32::MAX),
            });
            match op {
                Op::Binary(Binary::Div, _, by) => divides[by.index()] += 1,
                Op::Unary(op @ (Unary::Sin | Unary::Cos), angle) => {
                    let waves = waves.entry(angle.0).or_insert([None; 2]);
                    waves[usize::from(*op == Unary::Cos)] = Some(place);
                }
                _ => {}
            }
        }
        Self {
            ops,
            uses,
            divides,
            waves,
            first_input,
            steps: Vec::with_capacity(ops.len()),
            step_of: vec![None; ops.len()],
            reciprocals: HashMap::new(),
            more: Vec::new(),
        }
    }

    fn write(&mut self, place: usize, op: Op) {
        match op {
            Op::Const(_) | Op::Input(_) => {}
            Op::Unary(op @ (Unary::Sin | Unary::Cos), angle) => self.wave(place, op, angle.0),
            Op::Unary(op, a) => self.push(place, Kind::Unary(op), [a.0, 0, 0]),
            Op::Binary(op @ (Binary::Add | Binary::Sub), a, b) => {
                self.sum(place, op == Binary::Sub, a.0, b.0);
            }
            Op::Binary(Binary::Div, a, b) => match self.reciprocal(b.0) {
                Some(reciprocal) => self.push(place, PRODUCT, [a.0, reciprocal, 0]),
                None => self.push(place, Kind::Binary(Binary::Div), [a.0, b.0, 0]),
            },
            Op::Binary(op, a, b) => self.push(place, Kind::Binary(op), [a.0, b.0, 0]),
            Op::Where(condition, a, b) => self.push(place, Kind::Where, [a.0, b.0, condition.0]),
        }
    }

    fn push(&mut self, place: usize, kind: Kind, [a, b, c]: [u32; 3]) {
        self.step_of[place] = Some(self.steps.len());
        self.steps.push(Some(Step {
            kind,
            to: number(place),
            a,
            b,
            c,
            first_input: self.first_input[place],
        }));
    }

    /// Whichever of an angle's sine and cosine comes first computes both.
    fn wave(&mut self, place: usize, op: Unary, angle: u32) {
        match self.waves[&angle] {
            [Some(sine), Some(cosine)] if place == sine.min(cosine) => {
                self.push(place, Kind::SinCos, [angle, number(cosine), 0]);
                let step = self.steps.last_mut().and_then(Option::as_mut);
                step.expect("it was pushed just now").to = number(sine);
            }
            [Some(_), Some(_)] => {}
            _ => self.push(place, Kind::Unary(op), [angle, 0, 0]),
        }
    }

    fn sum(&mut self, place: usize, minus: bool, a: u32, b: u32) {
        let (b, minus) = match self.take(b, NEGATION) {
            Some(negated) => (negated.a, !minus),
            None => (b, minus),
        };
        let (a, b, minus) = match (!minus).then(|| self.take(a, NEGATION)).flatten() {
            Some(negated) => (b, negated.a, true),
            None => (a, b, minus),
        };
        if let Some(product) = self.take(b, PRODUCT) {
            let kind = if minus { Kind::SubMul } else { Kind::MulAdd };
            self.push(place, kind, [product.a, product.b, a]);
        } else if let Some(product) = self.take(a, PRODUCT) {
            let kind = if minus { Kind::MulSub } else { Kind::MulAdd };
            self.push(place, kind, [product.a, product.b, b]);
        } else {
            let op = if minus { Binary::Sub } else { Binary::Add };
            self.push(place, Kind::Binary(op), [a, b, 0]);
        }
    }

    /// Remove and return the step that writes a place, if it is of this kind and the place is read only once.
    fn take(&mut self, place: u32, kind: Kind) -> Option<Step> {
        let place = place as usize;
        let step = &mut self.steps[(*self.step_of.get(place)?)?];
        step.take_if(|step| step.kind == kind && self.uses[place] == 1)
    }

    /// The place of 1 / value if several divisions share it or the value is constant.
    fn reciprocal(&mut self, of: u32) -> Option<u32> {
        if let Some(known) = self.reciprocals.get(&of) {
            return Some(*known);
        }
        let place = self.ops.len() + self.more.len();
        let to = number(place);
        match self.ops[of as usize] {
            Op::Const(value) => self.more.push(Some(1.0 / value)),
            _ if self.divides[of as usize] < 2 => return None,
            _ => {
                self.more.push(None);
                self.steps.push(Some(Step {
                    kind: Kind::Reciprocal,
                    to,
                    a: of,
                    b: 0,
                    c: 0,
                    first_input: self.first_input[of as usize],
                }));
            }
        }
        self.reciprocals.insert(of, to);
        Some(to)
    }
}

impl Step {
    /// The places that it reads.
    pub fn reads(self) -> impl Iterator<Item = u32> {
        let count = match self.kind {
            Kind::Unary(_) | Kind::SinCos | Kind::Reciprocal => 1,
            Kind::Binary(_) => 2,
            Kind::Where | Kind::MulAdd | Kind::MulSub | Kind::SubMul => 3,
        };
        [self.a, self.b, self.c].into_iter().take(count)
    }

    /// The places that it writes.
    pub fn writes(self) -> impl Iterator<Item = u32> {
        let second = (self.kind == Kind::SinCos).then_some(self.b);
        [self.to].into_iter().chain(second)
    }
}

/// Topological order that groups steps of one kind: repeatedly take all ready steps of the kind that has most ready.
fn grouped(steps: &[Step]) -> Vec<Step> {
    let writers: HashMap<u32, usize> = (steps.iter().enumerate())
        .flat_map(|(index, step)| step.writes().map(move |place| (place, index)))
        .collect();
    let mut missing = vec![0; steps.len()];
    let mut readers = vec![Vec::new(); steps.len()];
    for (index, step) in steps.iter().enumerate() {
        for writer in step.reads().filter_map(|place| writers.get(&place)) {
            missing[index] += 1;
            readers[*writer].push(index);
        }
    }
    let mut ready: BTreeMap<Kind, VecDeque<usize>> = BTreeMap::new();
    for index in (0..steps.len()).filter(|index| missing[*index] == 0) {
        ready.entry(steps[index].kind).or_default().push_back(index);
    }
    let mut order = Vec::with_capacity(steps.len());
    while let Some((&kind, _)) = ready.iter().max_by_key(|(_, steps)| steps.len()) {
        while let Some(index) = ready.get_mut(&kind).and_then(VecDeque::pop_front) {
            order.push(steps[index]);
            for &reader in &readers[index] {
                missing[reader] -= 1;
                if missing[reader] == 0 {
                    ready
                        .entry(steps[reader].kind)
                        .or_default()
                        .push_back(reader);
                }
            }
        }
        ready.remove(&kind);
    }
    order
}

fn number(place: usize) -> u32 {
    u32::try_from(place).expect("fewer than 2^32 operations")
}
