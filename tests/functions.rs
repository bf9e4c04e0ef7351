//! Every function that a formula may call: its value and slopes, in every reader of programs.

use residyn_core::expr::{Graph, Program, Scope, SignForm, parse};
use residyn_train::replay;

use rand::RngExt;

use crate::support::catalogue::{assert_all_near, assert_near, column, in_f32, rng};
use crate::support::tensors::{devices, numbers, tensor};

/// A formula of x and y, its value and its slopes, written by hand.
struct Case {
    formula: &'static str,
    truth: fn(f64, f64) -> [f64; 3],
}

const fn case(formula: &'static str, truth: fn(f64, f64) -> [f64; 3]) -> Case {
    Case { formula, truth }
}

/// x and y lie in 0.3 to 1.4; formulas shift them to the range that they need.
const CASES: &[Case] = &[
    case("-x", |x, _| [-x, -1.0, 0.0]),
    case("x + y", |x, y| [x + y, 1.0, 1.0]),
    case("x - y", |x, y| [x - y, 1.0, -1.0]),
    case("x * y", |x, y| [x * y, y, x]),
    case("x / y", |x, y| [x / y, 1.0 / y, -x / (y * y)]),
    case("sin(x)", |x, _| [x.sin(), x.cos(), 0.0]),
    case("cos(x)", |x, _| [x.cos(), -x.sin(), 0.0]),
    case("tan(x)", |x, _| [x.tan(), x.cos().powi(-2), 0.0]),
    case("atan2(x, y)", |x, y| {
        [(x / y).atan(), y / (x * x + y * y), -x / (x * x + y * y)]
    }),
    // The signs of the two arguments cover all four quadrants.
    case("atan2(-x, -y)", |x, y| {
        let r = x * x + y * y;
        [(x / y).atan() - std::f64::consts::PI, y / r, -x / r]
    }),
    case("exp(x)", |x, _| [x.exp(), x.exp(), 0.0]),
    case("log(x)", |x, _| [x.ln(), 1.0 / x, 0.0]),
    case("sqrt(x)", |x, _| [x.sqrt(), 0.5 / x.sqrt(), 0.0]),
    case("abs(x)", |x, _| [x, 1.0, 0.0]),
    case("abs(-x)", |x, _| [x, 1.0, 0.0]),
    case("y * sign(x)", |_, y| [y, 0.0, 1.0]),
    case("y * sign(-x)", |_, y| [-y, 0.0, -1.0]),
    case("y * sign(x - x)", |_, _| [0.0, 0.0, 0.0]),
    case("tanh(x)", |x, _| [x.tanh(), x.cosh().powi(-2), 0.0]),
    case("min(x, y)", |x, y| {
        if x < y { [x, 1.0, 0.0] } else { [y, 0.0, 1.0] }
    }),
    case("max(x, y)", |x, y| {
        if x > y { [x, 1.0, 0.0] } else { [y, 0.0, 1.0] }
    }),
    case("clamp(x, 0.6, y + 0.6)", |x, y| match x {
        x if x < 0.6 => [0.6, 0.0, 0.0],
        x if x > y + 0.6 => [y + 0.6, 0.0, 1.0],
        x => [x, 1.0, 0.0],
    }),
    case("clamp(3 * x, 1.2, y + 1.5)", |x, y| match 3.0 * x {
        z if z < 1.2 => [1.2, 0.0, 0.0],
        z if z > y + 1.5 => [y + 1.5, 0.0, 1.0],
        z => [z, 3.0, 0.0],
    }),
    case("where(x < y, x * y, 2 * y)", |x, y| {
        if x < y {
            [x * y, y, x]
        } else {
            [2.0 * y, 0.0, 2.0]
        }
    }),
    case("where(x - y, x, y)", |x, y| {
        if x > y { [x, 1.0, 0.0] } else { [y, 0.0, 1.0] }
    }),
    case(
        "x * (x < y)",
        |x, y| if x < y { [x, 1.0, 0.0] } else { [0.0; 3] },
    ),
    case(
        "x * (x > y)",
        |x, y| if x > y { [x, 1.0, 0.0] } else { [0.0; 3] },
    ),
    case("x * (x <= y)", |x, y| {
        if x <= y { [x, 1.0, 0.0] } else { [0.0; 3] }
    }),
    case("x * (x >= y)", |x, y| {
        if x >= y { [x, 1.0, 0.0] } else { [0.0; 3] }
    }),
    case("y * (x < x)", |_, _| [0.0; 3]),
    case("y * (x <= x)", |_, y| [y, 0.0, 1.0]),
    case("(-x)^2", |x, _| [x * x, 2.0 * x, 0.0]),
    case("(-x)^3", |x, _| [-x * x * x, -3.0 * x * x, 0.0]),
    case("(-x)^4", |x, _| [x.powi(4), 4.0 * x.powi(3), 0.0]),
    case("x^0.5", |x, _| [x.sqrt(), 0.5 / x.sqrt(), 0.0]),
    case("x^-1.5", |x, _| [x.powf(-1.5), -1.5 * x.powf(-2.5), 0.0]),
    case("x^y", |x, y| {
        [x.powf(y), y * x.powf(y - 1.0), x.powf(y) * x.ln()]
    }),
    case("2^y", |_, y| {
        [y.exp2(), 0.0, y.exp2() * std::f64::consts::LN_2]
    }),
    case("sin(x * y)^2 / (1 + exp(-x))", |x, y| {
        let (s, c, e) = ((x * y).sin(), (x * y).cos(), (-x).exp());
        let value = s * s / (1.0 + e);
        [
            value,
            2.0 * s * c * y / (1.0 + e) + value * e / (1.0 + e),
            2.0 * s * c * x / (1.0 + e),
        ]
    }),
];

/// f64: a handful of operations.
const F64: f64 = 1e-14;
/// f32: a handful of operations of 6e-8 each; measured up to 1.5e-7.
const F32: f64 = 1e-6;

fn lower(formula: &str, sign: SignForm) -> (Graph, [residyn_core::expr::Node; 3]) {
    let mut graph = Graph::new();
    let mut scope = Scope::new(sign);
    let (x, y) = (graph.input("x"), graph.input("y"));
    scope.bind("x", x);
    scope.bind("y", y);
    let node = scope.lower(&mut graph, &parse(formula).unwrap()).unwrap();
    (graph, [node, x, y])
}

/// Value and both slopes.
fn program(formula: &str, sign: SignForm) -> Program {
    let (mut graph, [node, x, y]) = lower(formula, sign);
    let one = graph.constant(1.0);
    let slopes = graph.gradient(&[node], &[one], &[x, y]);
    graph.finish(&[node, slopes[0], slopes[1]])
}

fn value_alone(formula: &str) -> Program {
    let (graph, [node, ..]) = lower(formula, SignForm::Exact);
    graph.finish(&[node])
}

fn grid() -> Vec<Vec<f64>> {
    let mut rng = rng(31);
    let mut one = || f64::from(rng.random_range(0.3_f32..1.4));
    (0..64).map(|_| vec![one(), one()]).collect()
}

#[test]
fn values_and_slopes_in_f64() {
    for case in CASES {
        let program = program(case.formula, SignForm::Exact);
        for point in grid() {
            let truth = (case.truth)(point[0], point[1]);
            assert_all_near(&program.eval(&point), &truth, F64, case.formula);
        }
    }
}

#[test]
fn values_and_slopes_in_f32() {
    for case in CASES {
        let found = in_f32(&program(case.formula, SignForm::Exact), &grid());
        for (point, found) in grid().iter().zip(found) {
            let truth = (case.truth)(point[0], point[1]);
            assert_all_near(&found, &truth, F32, case.formula);
        }
    }
}

#[test]
fn values_and_slopes_on_tensors() {
    for device in devices() {
        for case in CASES {
            let truth: Vec<Vec<f64>> = grid()
                .iter()
                .map(|p| (case.truth)(p[0], p[1]).to_vec())
                .collect();
            let inputs = [0, 1].map(|k| tensor(&column(&grid(), k), &device).require_grad());
            let value = replay(&value_alone(case.formula), &inputs).swap_remove(0);
            let zeros = || vec![0.0; grid().len()];
            // An output that depends on no input has no gradients at all.
            let constant = truth.iter().all(|row| row[1..] == [0.0, 0.0]);
            let mut found = [numbers(value.clone()), zeros(), zeros()];
            if !constant || value.is_require_grad() {
                let gradients = value.sum().backward();
                for (k, input) in inputs.iter().enumerate() {
                    found[1 + k] = input.grad(&gradients).map_or_else(zeros, numbers);
                }
            }
            for (k, found) in found.iter().enumerate() {
                // A constant has one value for all rows.
                for (found, wanted) in found.iter().zip(column(&truth, k)) {
                    assert_near(*found, wanted, F32, &format!("{} ({k})", case.formula));
                }
            }
        }
    }
}

#[test]
fn a_smooth_sign_is_a_tanh_of_its_width() {
    let program = program("y * sign(x - 0.8)", SignForm::Smooth { width: 0.2 });
    for point in grid() {
        let (x, y) = (point[0], point[1]);
        let tanh = ((x - 0.8) / 0.2).tanh();
        let wanted = [y * tanh, y * (1.0 - tanh * tanh) / 0.2, tanh];
        assert_all_near(&program.eval(&point), &wanted, F64, "smooth sign");
    }
}

/// A NaN must reach the output in every reader.
#[test]
fn nan_propagates() {
    let nan = f64::NAN;
    for formula in [
        "min(x, y)",
        "max(x, y)",
        "clamp(x, -1, y)",
        "abs(x) + y",
        "x^y",
        "x * y",
        "tanh(x + y)",
    ] {
        for point in [[nan, 0.5], [0.5, nan]] {
            let program = value_alone(formula);
            let point = vec![point.to_vec()];
            assert!(
                program.eval(&point[0])[0].is_nan(),
                "{formula} of {point:?} in f64"
            );
            assert!(
                in_f32(&program, &point)[0][0].is_nan(),
                "{formula} of {point:?} in f32"
            );
            for device in devices() {
                let inputs = [0, 1].map(|k| tensor(&point[0][k..=k], &device));
                let value = numbers(replay(&program, &inputs).swap_remove(0))[0];
                assert!(
                    value.is_nan(),
                    "{formula} of {point:?} on {device:?}: {value}"
                );
            }
        }
    }
}
