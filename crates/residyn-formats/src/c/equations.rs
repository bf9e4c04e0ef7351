use std::fmt::Write;

use super::{Names, networks};
use crate::ExportModel;
use residyn_core::expr::{Graph, Node, Program};

/// The functions of the derivative and its Jacobian.
pub(super) fn derivative(model: &ExportModel, names: &Names) -> String {
    let program = &model.equations.program;
    let rates: Vec<String> = (0..2 * model.joints())
        .map(|k| format!("rates[{k}]"))
        .collect();
    include_str!("derivative.h")
        .replace(
            "RATES\n",
            &(assignments(program, &rates, names) + &networks::added(model)),
        )
        .replace(
            "JACOBIAN\n",
            &(jacobian(model, names) + &networks::jacobian_added(model)),
        )
}

/// The function for the inverse dynamics; empty with a network or without a torque balance.
pub(super) fn inverse(model: &ExportModel, names: &Names) -> String {
    if model.prior.is_some() || model.residual.is_some() {
        return String::new();
    }
    let Some(balance) = model.system.torque_balance() else {
        return String::new();
    };
    let needed: Vec<String> = (0..model.joints())
        .map(|joint| format!("needed[{joint}]"))
        .collect();
    let assignments = assignments(&balance.program, &needed, names);
    include_str!("inverse.h").replace("NEEDED\n", &assignments)
}

fn jacobian(model: &ExportModel, names: &Names) -> String {
    let n = model.joints();
    let program = &model.equations.program;
    let mut graph = Graph::new();
    let inputs: Vec<Node> = program
        .inputs()
        .iter()
        .map(|name| graph.input(name))
        .collect();
    let rates = graph.append(program, &inputs);
    let rows = graph.jacobian(&rates, &inputs[..3 * n]);
    let place = |row: usize, column: usize| match column.checked_sub(2 * n) {
        None => format!("by_state[{row}][{column}]"),
        Some(joint) => format!("by_torque[{row}][{joint}]"),
    };
    let places: Vec<String> = (0..2 * n)
        .flat_map(|row| (0..3 * n).map(move |column| place(row, column)))
        .collect();
    assignments(&graph.finish(&rows.concat()), &places, names)
}

fn assignments(program: &Program, outputs: &[String], names: &Names) -> String {
    let outputs: Vec<&str> = outputs.iter().map(String::as_str).collect();
    let mut text = String::new();
    for (left, right) in program.assignments(names, &outputs) {
        let _ = match outputs.contains(&left.as_str()) {
            true => writeln!(text, "    {left} = {right};"),
            false => writeln!(text, "    const model_real {left} = {right};"),
        };
    }
    text
}
