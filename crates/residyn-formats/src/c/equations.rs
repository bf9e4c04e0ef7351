use std::fmt::Write;

use super::{Names, networks};
use crate::ExportModel;
use residyn_core::expr::{Graph, Node, Program};

/// The functions of the derivative and its Jacobian. If effects have states, these are those of the mean rates over a step, for
/// one of no length.
pub(super) fn derivative(model: &ExportModel, names: &Names) -> String {
    let program = &model.equations.program;
    let rates: Vec<String> = (0..model.states()).map(|k| format!("rates[{k}]")).collect();
    let rates = assignments(program, &rates, names) + &networks::added(model);
    let jacobian = jacobian(model, names) + &networks::jacobian_added(model);
    let written = |template: &str, rates: &str, jacobian: &str| {
        let template = template.replace("RATES\n", rates);
        template.replace("JACOBIAN\n", jacobian)
    };
    let at_a_moment = include_str!("derivative.h");
    let Some(internal) = &model.equations.internal else {
        return written(at_a_moment, &rates, &jacobian);
    };
    let places = model.equations.layout().internal();
    let places: Vec<String> = places.map(|k| format!("state[{k}]")).collect();
    let starts = assignments(&internal.starts, &places, names);
    let means = include_str!("mean_rates.h").replace("STARTS\n", &starts);
    let [moment, of_moment] = [include_str!("moment.h"), include_str!("moment_jacobian.h")];
    written(&means, &rates, &jacobian) + &written(at_a_moment, moment, of_moment)
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
    let (program, layout) = (&model.equations.program, model.equations.layout());
    let mut graph = Graph::new();
    let inputs: Vec<Node> = program
        .inputs()
        .iter()
        .map(|name| graph.input(name))
        .collect();
    let rates = graph.append(program, &inputs);
    let parts = [
        ("by_state", layout.states()),
        ("by_torque", layout.driving()),
        ("by_begun", layout.starts()),
    ];
    let columns = parts.clone().map(|(_, places)| inputs[places].to_vec());
    let rows = graph.jacobian(&rates, &columns.concat());
    let columns = parts
        .iter()
        .flat_map(|(part, places)| (0..places.len()).map(move |column| (*part, column)));
    let columns: Vec<(&str, usize)> = columns.collect();
    let places = (0..rates.len()).flat_map(|row| {
        let place = move |(part, column): &(&str, usize)| format!("{part}[{row}][{column}]");
        columns.iter().map(place)
    });
    let places: Vec<String> = places.collect();
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
