//! Printed equations mean the same as the program.

use std::collections::HashMap;

use residyn_core::data::{Joint, Quantity};
use residyn_core::expr::{Graph, Node, Program, Scope, SignForm, parse};
use residyn_core::model::{Dynamics, Library};

use crate::support::catalogue::{
    all_systems, assert_all_near, can_act, catalog, fitted, jacobian, points,
};

const SIGNS: [SignForm; 2] = [SignForm::Exact, SignForm::Smooth { width: 0.05 }];

/// The lines `name = formula` of a text as a program with the same inputs.
fn read_back(text: &str, inputs: &[String], outputs: &[String]) -> Program {
    let mut graph = Graph::new();
    let mut scope = Scope::new(SignForm::Exact);
    for name in inputs {
        let node = graph.input(name);
        scope.bind(name, node);
    }
    let mut lines: HashMap<&str, Node> = HashMap::new();
    for line in text.lines() {
        let (name, formula) = line.split_once(" = ").unwrap();
        let node = scope.lower(&mut graph, &parse(formula).unwrap()).unwrap();
        scope.bind(name, node);
        lines.insert(name, node);
    }
    let nodes: Vec<Node> = outputs.iter().map(|name| lines[name.as_str()]).collect();
    graph.finish(&nodes)
}

fn names(count: usize) -> Vec<String> {
    (1..=count).map(|k| format!("out_{k}")).collect()
}

fn check_text(name: &str, program: &Program, points: &[Vec<f64>]) {
    let outputs = names(program.output_count());
    let borrowed: Vec<&str> = outputs.iter().map(String::as_str).collect();
    let again = read_back(&program.text(&borrowed), program.inputs(), &outputs);
    for point in points {
        // The same operations in the same order: no rounding except that of folded constants.
        assert_all_near(&again.eval(point), &program.eval(point), 1e-14, name);
    }
}

#[test]
fn text_reads_back_as_the_same_function() {
    for case in SIGNS.into_iter().flat_map(catalog) {
        check_text(
            &case.name,
            &case.dynamics.program,
            &points(&case.dynamics, 20, 4),
        );
    }
}

#[test]
fn text_of_gradients_reads_back_too() {
    for case in catalog(SignForm::Exact) {
        check_text(
            &case.name,
            &jacobian(&case.dynamics),
            &points(&case.dynamics, 5, 4),
        );
    }
}

#[test]
fn formulas_with_every_intermediate_written_out_read_back() {
    for case in catalog(SignForm::Exact) {
        let program = &case.dynamics.program;
        let outputs = names(program.output_count());
        let lines: Vec<String> = outputs
            .iter()
            .enumerate()
            .map(|(k, o)| format!("{o} = {}", program.formula(k)))
            .collect();
        let again = read_back(&lines.join("\n"), program.inputs(), &outputs);
        for point in points(&case.dynamics, 5, 4) {
            let wanted = program.eval(&point);
            assert_all_near(&again.eval(&point), &wanted, 1e-14, &case.name);
        }
    }
}

/// Precedence, signs and associativity in cases that are easy to get wrong.
#[test]
fn awkward_formulas_read_back_and_are_balanced_in_latex() {
    let inputs = ["x", "y", "z"].map(str::to_owned);
    let formulas = [
        "x - (y - z)",
        "x - y - z",
        "x / (y / z)",
        "x / y * z",
        "x / (y * z)",
        "x * (y / z)",
        "-x^1.5",
        "(-x)^3",
        "x^-1.5",
        "x^(y^z)",
        "(x^y)^z",
        "-(x + y)",
        "x - -y",
        "-2 * -x",
        "2 - (-3) * x",
        "(x < y) + (y < z)",
        "x <= y",
        "(x >= y) * z",
        "where((x < y) * (y < z), x, -y)",
        "1e-9 * x + 1e20 * y",
        "x^0.1 * 1.0000000000000002",
        "clamp(-x, -y, z)",
        "(-x * y)^2.5 * 0 + (x * y)^2.5",
        "(x / y)^2.5",
        "(x + y)^2",
        "abs(-x)^1.5",
    ];
    for formula in formulas {
        let program = read_back(&format!("out_1 = {formula}"), &inputs, &names(1));
        let points = [
            [0.3, 1.2, 0.7],
            [1.4, 0.5, 2.2],
            [0.6, 0.6, 0.6],
            [0.2, 0.4, 0.9],
        ];
        check_text(formula, &program, &points.map(Vec::from));
        check_latex(formula, &program.latex(&["out_1"]));
    }
}

fn check_latex(name: &str, latex: &str) {
    let mut depth = 0_i32;
    for c in latex.chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        assert!(
            depth >= 0,
            "{name}: a brace closes that never opened: {latex}"
        );
    }
    assert_eq!(depth, 0, "{name}: a brace stays open: {latex}");
    let count = |part: &str| latex.matches(part).count();
    assert_eq!(count("\\left"), count("\\right"), "{name}: {latex}");
    assert_eq!(count("\\begin{"), count("\\end{"), "{name}: {latex}");
    assert!(
        !latex.contains("NaN") && !latex.contains("inf"),
        "{name}: {latex}"
    );
}

fn latex(model: &Dynamics) -> String {
    let n = model.joints;
    let rates = ["qd", "qdd"]
        .into_iter()
        .flat_map(|s| (1..=n).map(move |j| format!("{s}{j}")));
    let rates: Vec<String> = rates.collect();
    let borrowed: Vec<&str> = rates.iter().map(String::as_str).collect();
    model.program.latex(&borrowed)
}

#[test]
fn latex_is_balanced() {
    for case in SIGNS.into_iter().flat_map(catalog) {
        let latex = latex(&case.dynamics);
        check_latex(&case.name, &latex);
        for line in latex.split(" \\\\\n") {
            // One alignment mark per line; marks within cases belong to the cases.
            let own = line.matches(" &= ").count();
            assert_eq!(own, 1, "{}: {line}", case.name);
        }
    }
}

#[test]
fn an_effects_expression_names_its_joint_and_reads_back() {
    let library = Library::built_in();
    for system in all_systems() {
        for effect in library.effects() {
            // A filter is described in its own words, see memory.rs, and so are states, see internal_states.rs.
            if effect.entry.formula().is_none() || !effect.states.is_empty() {
                continue;
            }
            for joint in (0..system.joints).filter(|j| can_act(&system, effect, *j)) {
                let values = vec![1.0; effect.parameters.len()];
                let fitted = fitted(effect, joint, &values);
                let taken: Vec<&str> = system.parameters.iter().map(|p| p.name.as_str()).collect();
                let own = fitted.parameter_names(&taken);
                let formula = parse(&fitted.expression(&own, Quantity::Torque)).unwrap();
                for name in formula.names() {
                    let of =
                        |joint: Joint| ["q", "qd", "qdd", "tau", "load"].map(|s| joint.name(s));
                    let state: Vec<String> = fitted.joints().into_iter().flat_map(of).collect();
                    let known = own.iter().chain(&state).any(|known| known == name);
                    assert!(known, "{}: `{name}` in {}", effect.name, formula.text());
                    let declared = system.parameters.iter().any(|p| p.name == name);
                    assert!(
                        !declared,
                        "{}: `{name}` is taken in {}",
                        effect.name, system.name
                    );
                }
            }
        }
    }
}
