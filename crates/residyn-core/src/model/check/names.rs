//! Names that hide others, or are easily taken for them.

use super::{Finding, Kind};
use crate::expr::is_function;
use crate::model::system::Model;

/// Quantities of joints, named with the joint's number.
const NUMBERED: [&str; 6] = ["q", "qd", "qdd", "tau", "cmd", "load"];

pub(super) fn find(model: &Model) -> Vec<Finding> {
    let finding = |line: Option<usize>, text: String| Finding::new(Kind::Name, line, text);
    let parameters = model
        .parameters
        .iter()
        .map(|parameter| parameter.name.as_str());
    let lets = model.equations.lets.iter().map(|(name, _)| name.as_str());
    let of_parameters = parameters
        .filter_map(|name| Some(finding(model.line_of_parameter(name), taken_for(name)?)));
    let of_lets = lets.filter_map(|name| Some(finding(model.line_of_let(name), taken_for(name)?)));
    let of_effects = model.effects.iter().enumerate().flat_map(|(k, _)| {
        let line = model.line_of_effect(k);
        let texts = renamed(model, k).into_iter().chain(hiding(model, k));
        texts
            .map(move |text| finding(line, text))
            .collect::<Vec<_>>()
    });
    of_parameters.chain(of_lets).chain(of_effects).collect()
}

/// What a declared name may be mistaken for.
fn taken_for(name: &str) -> Option<String> {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    if is_function(name) {
        Some(format!("`{name}` is also a function: choose another name"))
    } else if NUMBERED.contains(&stem) {
        Some(format!(
            "`{name}` reads like a quantity of a joint: choose another name"
        ))
    } else {
        None
    }
}

/// Parameters of the k-th effect whose names are taken by declared ones.
fn renamed(model: &Model, k: usize) -> Vec<String> {
    let effect = &model.effects[k];
    let own: Vec<&str> = model.own_names().collect();
    let plain = effect.parameter_names(&[]);
    let names = plain.iter().zip(effect.parameter_names(&own));
    names
        .filter(|(plain, name)| *plain != name)
        .map(|(plain, name)| {
            format!(
                "`{plain}` is already declared, so this parameter of {} is called `{name}` in reports",
                effect.label()
            )
        })
        .collect()
}

/// Parameters of the k-th effect that hide the motion of the joint from its own formula.
fn hiding(model: &Model, k: usize) -> Vec<String> {
    let effect = &model.effects[k].effect;
    let known = effect.entry.names();
    let names = effect.names();
    names
        .filter(|name| known.contains(name) || is_function(name))
        .map(|name| {
            format!(
                "the parameter `{name}` of {} hides the quantity that formulas know by that name",
                effect.name
            )
        })
        .collect()
}
