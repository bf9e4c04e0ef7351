use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::expr::op::Op;
use crate::expr::{Binary, Graph, Node, Program, Unary};
use crate::lanes::{Element, Row, Simd};

const INPUTS: usize = 4;
const UNARY: [Unary; 10] = [
    Unary::Neg,
    Unary::Sin,
    Unary::Cos,
    Unary::Tan,
    Unary::Exp,
    Unary::Log,
    Unary::Sqrt,
    Unary::Abs,
    Unary::Sign,
    Unary::Tanh,
];
const BINARY: [Binary; 9] = [
    Binary::Add,
    Binary::Sub,
    Binary::Mul,
    Binary::Div,
    Binary::Pow,
    Binary::Atan2,
    Binary::Min,
    Binary::Max,
    Binary::Less,
];

/// Some operations on the nodes before them, mostly sums and products.
fn program(rng: &mut ChaCha8Rng) -> Program {
    let mut graph = Graph::new();
    let mut nodes: Vec<Node> = (0..INPUTS).map(|k| graph.input(&format!("x{k}"))).collect();
    nodes.push(graph.constant(rng.random_range(-2.0..2.0)));
    for _ in 0..rng.random_range(1..14) {
        let [a, b, c] = [(); 3].map(|()| nodes[rng.random_range(0..nodes.len())]);
        nodes.push(match rng.random_range(0..9) {
            0 | 1 => graph.unary(UNARY[rng.random_range(0..UNARY.len())], a),
            2 | 3 => graph.binary(BINARY[rng.random_range(0..BINARY.len())], a, b),
            4 => graph.select(a, b, c),
            5 => graph.mul(a, b),
            6 => graph.div(a, b),
            7 => graph.sub(a, b),
            _ => graph.add(a, b),
        });
    }
    let outputs = [nodes[nodes.len() - 1], nodes[nodes.len() - 2]];
    graph.finish(&outputs)
}

/// Each operation's value one by one, and how far it may be off if each rounds to a few parts in 1 / `unit`: infinite
/// where rounding may flip a decision.
fn plain(program: &Program, inputs: &[f64], unit: f64) -> Vec<(f64, f64)> {
    let mut known: Vec<(f64, f64)> = Vec::new();
    for op in program.ops() {
        let at = |node: Node| known[node.index()];
        let (value, spread) = match *op {
            Op::Const(value) => (value, 0.0),
            Op::Input(k) => (inputs[k as usize], 0.0),
            Op::Unary(op, a) => {
                let (a, off) = at(a);
                let value = op.apply(a);
                let spread = if off == 0.0 || value.is_nan() && a.abs() > off {
                    0.0
                } else {
                    spread_of_unary(op, a, off, value)
                };
                (value, spread)
            }
            Op::Binary(op, a, b) => {
                let ((a, off_a), (b, off_b)) = (at(a), at(b));
                let value = op.apply(a, b);
                let spread = if off_a + off_b == 0.0 {
                    0.0
                } else {
                    spread_of_binary(op, [a, b], [off_a, off_b], value)
                };
                (value, spread)
            }
            Op::Where(c, a, b) => {
                let ((c, off), (a, off_a), (b, off_b)) = (at(c), at(a), at(b));
                let (value, spread) = if c > 0.0 { (a, off_a) } else { (b, off_b) };
                (value, decided(c, off, spread))
            }
        };
        let rounding = if value.is_nan() {
            0.0
        } else {
            unit * value.abs()
        };
        known.push((value, spread + rounding));
    }
    known
}

/// `then` if the sign of `a`, which may be off by `off`, is certain.
fn decided(a: f64, off: f64, then: f64) -> f64 {
    if a.abs() > off || off == 0.0 {
        then
    } else {
        f64::INFINITY
    }
}

/// How far the value of `op` at `a` may be off if `a` is off by `off`.
fn spread_of_unary(op: Unary, a: f64, off: f64, value: f64) -> f64 {
    match op {
        Unary::Neg | Unary::Abs | Unary::Sin | Unary::Cos | Unary::Tanh => off,
        Unary::Tan => off * (1.0 + value * value),
        Unary::Exp => off * value,
        Unary::Log => decided(a, 10.0 * off, off / a.abs()),
        Unary::Sqrt => decided(a, 10.0 * off, off / value),
        Unary::Sign => decided(a, off, 0.0),
    }
}

/// As above, for two operands.
fn spread_of_binary(op: Binary, [a, b]: [f64; 2], [off_a, off_b]: [f64; 2], value: f64) -> f64 {
    match op {
        Binary::Add | Binary::Sub => off_a + off_b,
        Binary::Mul => a.abs() * off_b + b.abs() * off_a,
        Binary::Div => decided(b, 10.0 * off_b, (off_a + value.abs() * off_b) / b.abs()),
        Binary::Pow => {
            let parts = b * off_a / a.abs() + a.abs().ln() * off_b;
            // Only whole powers of a negative number are real.
            let fragile = a <= 10.0 * off_a || off_b > 0.0 && a < 0.0;
            if fragile && off_a + off_b > 0.0 {
                f64::INFINITY
            } else {
                4.0 * (parts * value).abs()
            }
        }
        Binary::Atan2 => {
            let round = off_a + off_b;
            // The angle jumps behind the origin.
            let fragile = b < 0.0 && a.abs() <= off_a || a.hypot(b) <= 10.0 * round;
            if fragile && round > 0.0 {
                f64::INFINITY
            } else {
                round / a.hypot(b)
            }
        }
        Binary::Min | Binary::Max => off_a.max(off_b),
        Binary::Less => decided(a - b, off_a + off_b, 0.0),
    }
}

/// Compare the tape with the plain values; returns how many could be compared.
fn compare<T: Element, const W: usize, S: Simd>(simd: impl Fn() -> Option<S>, unit: f64) -> usize {
    let Some(simd) = simd() else { return 0 };
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut compared = 0;
    for _ in 0..3000 {
        let program = program(&mut rng);
        let held = rng.random_range(0..=INPUTS);
        let mut tape = program.tape_with_held::<T, W>(held);
        let mut inputs = [[0.0; W]; INPUTS];
        for round in 0..2 {
            // First all inputs, then all that move.
            let changed = if round == 0 { INPUTS } else { held };
            for input in &mut inputs[..changed] {
                *input = std::array::from_fn(|_| f64::from(rng.random_range(-3.0_f32..3.0)));
            }
            let slots = if round == 0 {
                tape.inputs()
            } else {
                tape.moving()
            };
            for (slot, input) in slots.iter_mut().zip(&inputs[..changed]) {
                *slot = Row(input.map(|x| T::from_f64(x).unwrap()));
            }
            Simd::vectorize(simd, super::CarryOut(&mut tape));
            for lane in 0..W {
                let wanted = plain(&program, &inputs.map(|input| input[lane]), unit);
                for (k, output) in program.outputs.iter().enumerate() {
                    let (wanted, off) = wanted[output.index()];
                    let found = tape.output(k)[lane].to_f64().unwrap();
                    if !off.is_finite() || wanted.abs() > 1e30 {
                        continue;
                    }
                    compared += 1;
                    assert!(
                        (found - wanted).abs() <= 8.0 * off + 1e-37
                            || found.is_nan() && wanted.is_nan(),
                        "found {found}, wanted {wanted} to {off} of {:?}",
                        program.ops(),
                    );
                }
            }
        }
    }
    compared
}

fn everywhere<T: Element, const W: usize>(unit: f64) {
    use pulp::Scalar;
    let plain = compare::<T, W, Scalar>(|| Some(Scalar), unit);
    assert!(plain > 6000 * W, "{plain}");
    #[cfg(target_arch = "x86_64")]
    {
        compare::<T, W, _>(pulp::x86::V3::try_new, unit);
        compare::<T, W, _>(pulp::x86::V4::try_new, unit);
    }
}

#[test]
fn random_programs_in_f64_match_their_operations() {
    everywhere::<f64, 1>(f64::EPSILON);
    everywhere::<f64, 8>(f64::EPSILON);
    everywhere::<f64, 32>(f64::EPSILON);
}

#[test]
fn random_programs_in_f32_match_their_operations() {
    everywhere::<f32, 1>(f64::from(f32::EPSILON));
    everywhere::<f32, 8>(f64::from(f32::EPSILON));
    everywhere::<f32, 32>(f64::from(f32::EPSILON));
}

#[test]
fn held_steps_are_evaluated_again_after_a_change() {
    let mut graph = Graph::new();
    let [x, p] = ["x", "p"].map(|name| graph.input(name));
    let square = graph.mul(p, p);
    let wave = graph.unary(Unary::Sin, square);
    let sum = graph.add(wave, x);
    let program = graph.finish(&[sum]);
    let mut tape = program.tape_with_held::<f64, 8>(1);
    let mut held = 0.0;
    for (x, p) in [(1.0, 2.0), (1.5, 2.0), (1.5, 3.0), (0.5, 3.0)] {
        if p != held {
            held = p;
            tape.inputs()[1] = Row::splat(p);
        }
        tape.moving()[0] = Row::splat(x);
        tape.run();
        assert!((tape.output(0)[5] - ((p * p).sin() + x)).abs() < 1e-15);
    }
}
