//! Formulas: printed and parsed, differentiated.

use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL};
use proptest::prelude::*;
use residyn_core::expr::{Graph, Program, Scope, SignForm, parse};

use super::{cases, same_number};

const INPUTS: [&str; 3] = ["x", "y", "p_1"];

/// Numbers of usual size.
fn usual_number() -> impl Strategy<Value = String> {
    prop_oneof![
        3 => (0..13_u32).prop_map(|n| n.to_string()),
        3 => (0.0..4.0_f64).prop_map(|x| format!("{x}")),
        1 => (0..1000_u32).prop_map(|n| format!("{}.{}", n / 10, n % 10)),
    ]
}

/// Numbers as people and programs write them, from the smallest to the largest.
fn number() -> impl Strategy<Value = String> {
    prop_oneof![
        7 => usual_number(),
        1 => (POSITIVE | NORMAL | SUBNORMAL).prop_map(|x| format!("{x:e}")),
        1 => (0..400_u32).prop_map(|n| format!("1e-{n}")),
    ]
}

/// Formulas with every operation, with some redundant parentheses and some omitted where they might be expected.
pub fn formula() -> impl Strategy<Value = String> {
    formula_of(number())
}

/// As [`formula`], with numbers of usual size.
pub fn usual_formula() -> impl Strategy<Value = String> {
    formula_of(usual_number())
}

fn formula_of(number: impl Strategy<Value = String> + 'static) -> impl Strategy<Value = String> {
    let name = prop::sample::select(INPUTS.to_vec()).prop_map(str::to_owned);
    let leaf = prop_oneof![3 => name, 2 => number];
    leaf.prop_recursive(6, 48, 3, |inner| {
        let infix = prop::sample::select(vec!["+", "-", "*", "/", "^", "<", ">", "<=", ">="]);
        let one = ["abs", "cos", "exp", "log", "sign", "sin", "sqrt", "tan", "tanh"];
        let two = prop::sample::select(vec!["atan2", "max", "min"]);
        let three = prop::sample::select(vec!["clamp", "where"]);
        let one = prop::sample::select(one.to_vec());
        let pair = || (inner.clone(), inner.clone());
        prop_oneof![
            2 => (inner.clone(), infix.clone(), inner.clone()).prop_map(|(a, o, b)| format!("{a} {o} {b}")),
            3 => (inner.clone(), infix, inner.clone()).prop_map(|(a, o, b)| format!("({a}){o}({b})")),
            1 => inner.clone().prop_map(|a| format!("-{a}")),
            1 => inner.clone().prop_map(|a| format!("-({a})")),
            2 => (one, inner.clone()).prop_map(|(f, a)| format!("{f}({a})")),
            1 => (two, pair()).prop_map(|(f, (a, b))| format!("{f}({a}, {b})")),
            1 => (three, pair(), inner.clone()).prop_map(|(f, (a, b), c)| format!("{f}({a}, {b}, {c})")),
        ]
    })
}

/// Values of the inputs: usual ones, equal ones, zeros of both signs, large and small ones.
pub fn point() -> impl Strategy<Value = [f64; 3]> {
    let value = prop_oneof![
        6 => -4.0..4.0_f64,
        1 => prop::sample::select(vec![0.0, -0.0, 1.0, -1.0, 2.0, 0.5]),
        1 => NORMAL | NEGATIVE | POSITIVE,
    ];
    prop::array::uniform3(value)
}

fn program(formula: &str) -> Program {
    parse(formula).unwrap().program(INPUTS).unwrap()
}

/// The lines of a text, the last of which is the output.
fn read_back(text: &str) -> Program {
    let mut graph = Graph::new();
    let mut scope = Scope::of_inputs(&mut graph, INPUTS);
    let mut last = None;
    for line in text.lines() {
        let (name, formula) = line.split_once(" = ").unwrap();
        let node = scope.lower(&mut graph, &parse(formula).unwrap()).unwrap();
        scope.bind(name, node);
        last = Some(node);
    }
    graph.finish(&[last.unwrap()])
}

fn same(a: &Program, b: &Program, points: &[[f64; 3]]) -> Result<(), TestCaseError> {
    for point in points {
        let [a, b] = [a, b].map(|program| program.eval(point)[0]);
        prop_assert!(same_number(a, b), "{a:?} and {b:?} at {point:?}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(cases(2000))]

    #[test]
    fn what_is_printed_reads_back_to_the_last_bit(
        formula in formula(),
        points in prop::collection::vec(point(), 8),
    ) {
        let once = program(&formula);
        let printed = once.formula(0);
        let again = program(&printed);
        same(&once, &again, &points)?;
        prop_assert_eq!(again.formula(0), &*printed);
        same(&once, &read_back(&once.text(&["out"])), &points)?;
    }

    #[test]
    fn what_is_derived_prints_and_reads_back_too(
        formula in formula(),
        points in prop::collection::vec(point(), 4),
    ) {
        let slope = derived(&formula, 0);
        same(&slope, &read_back(&slope.text(&["out"])), &points)?;
    }

    #[test]
    fn latex_is_balanced(formula in formula()) {
        let latex = program(&formula).latex_formula(0);
        let depth = latex.chars().fold(0_i32, |depth, c| match c {
            '{' => depth + 1,
            '}' => depth - 1,
            _ => depth,
        });
        prop_assert_eq!(depth, 0, "{}", latex);
        prop_assert_eq!(latex.matches("\\left").count(), latex.matches("\\right").count(), "{}", latex);
        prop_assert!(!latex.contains("NaN") && !latex.contains("inf"), "{}", latex);
    }
}

/// The derivative by one of the inputs.
fn derived(formula: &str, by: usize) -> Program {
    let mut graph = Graph::new();
    let mut scope = Scope::new(SignForm::Exact);
    let inputs = INPUTS.map(|name| graph.input(name));
    for (name, node) in INPUTS.into_iter().zip(inputs) {
        scope.bind(name, node);
    }
    let node = scope.lower(&mut graph, &parse(formula).unwrap()).unwrap();
    let one = graph.constant(1.0);
    let slope = graph.gradient(&[node], &[one], &[inputs[by]])[0];
    graph.finish(&[slope])
}

/// A slope from differences, and its possible error.
struct Difference {
    slope: f64,
    error: f64,
}

/// Central differences over h and h / 2, extrapolated (Richardson). Their error has two parts: the truncation error,
/// which is below the difference between the two if they converge as a smooth function's do, by a factor of 4 for each
/// halving of h; and rounding, of the input and as the function's own values show: over a few spacings of
/// floating-point numbers they should not bend.
/// `None` if the differences do not converge in this way: at a kink, near a pole, or when only rounding is left, of the
/// value or of the input next to a large number.
fn difference(program: &Program, point: &[f64; 3], by: usize) -> Option<Difference> {
    let at = |moved: f64| {
        let mut point = *point;
        point[by] += moved;
        program.eval(&point)[0]
    };
    let h = 1e-3 * point[by].abs().max(0.1);
    let over = |h: f64| (at(h) - at(-h)) / (2.0 * h);
    let [coarse, fine, finest] = [h, h / 2.0, h / 4.0].map(over);
    let spacing = 8.0 * f64::EPSILON * point[by].abs().max(0.1);
    let near: Vec<f64> = (-4..=4).map(|k| at(spacing * f64::from(k))).collect();
    let bend = |three: &[f64]| (three[0] - 2.0 * three[1] + three[2]).abs();
    let rounding = near.windows(3).map(bend).fold(0.0, f64::max)
        + f64::EPSILON * near.iter().fold(0.0_f64, |most, x| most.max(x.abs()))
        + f64::EPSILON * (point[by] * finest).abs();
    let noise = 8.0 * rounding / h;
    let [first, second] = [(coarse - fine).abs(), (fine - finest).abs()];
    let converges = second <= 0.3 * first || first <= noise;
    // At a kink, the slopes on both sides stay apart at any distance.
    let apart = |h: f64| (at(h) - 2.0 * at(0.0) + at(-h)).abs() / h;
    let converges = converges && apart(h / 4.0) <= 0.75 * apart(h / 2.0) + noise;
    let slope = finest + (finest - fine) / 3.0;
    let error = second + noise;
    let is_sharp = error <= 1e-4 * slope.abs().max(1e-6);
    let is_lost = at(h) == at(0.0) && at(-h) == at(0.0);
    (converges && is_sharp && !is_lost && slope.is_finite()).then_some(Difference { slope, error })
}

#[test]
fn derivatives_are_what_differences_tend_to() {
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;

    let config = cases(6000);
    let mut runner = TestRunner::new(config.clone());
    let (mut compared, mut singular) = (0, 0);
    for _ in 0..config.cases {
        // With numbers of any size, most formulas overflow or lose their inputs to rounding.
        let formula = usual_formula();
        let formula = formula.new_tree(&mut runner).unwrap().current();
        let point = prop::array::uniform3(-4.0..4.0_f64);
        let point = point.new_tree(&mut runner).unwrap().current();
        let value = program(&formula);
        for by in 0..INPUTS.len() {
            let Some(Difference { slope, error }) = difference(&value, &point, by) else {
                continue;
            };
            let found = derived(&formula, by).eval(&point)[0];
            // For example the root of x y with respect to x at y = 0: infinity times zero.
            if found.is_nan() {
                singular += 1;
                continue;
            }
            // Rounding within a formula may cancel in all values used here.
            assert!(
                (found - slope).abs() <= error + 1e-9 * slope.abs(),
                "{formula} by {} at {point:?}: {found}, and {slope} to {error:e} by differences",
                INPUTS[by]
            );
            compared += 1;
        }
    }
    // Most contain no input, are steps, or overflow.
    assert!(compared > config.cases / 4, "{compared}");
    assert!(100 * singular < compared, "{singular} of {compared}");
}

/// A joint that starts at rest has a speed of zero, to whatever power.
#[test]
fn powers_of_zero_have_derivatives() {
    for (formula, by, wanted) in [
        ("x^p_1", 2, 0.0),
        ("abs(x)^p_1", 2, 0.0),
        ("y * x^p_1", 1, 0.0),
        ("x^(p_1 * y)", 1, 0.0),
        ("(1 + x)^p_1", 2, 0.0),
        ("(2 + x)^p_1", 2, 2.0_f64.powf(1.5) * 2.0_f64.ln()),
    ] {
        let found = derived(formula, by).eval(&[0.0, 2.0, 1.5])[0];
        assert!((found - wanted).abs() < 1e-14, "{formula}: {found}");
    }
    assert!(derived("x^p_1", 2).eval(&[f64::NAN, 2.0, 1.5])[0].is_nan());
}
