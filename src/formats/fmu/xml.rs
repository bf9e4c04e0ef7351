use std::collections::BTreeSet;
use std::fmt::Write;

use super::unit::{BASE, exponents};
use super::variables::{Role, Variable};

/// `Unit` elements of all units of the variables; the same in both versions.
pub(super) fn units(variables: &[Variable]) -> String {
    let used = variables.iter().map(|variable| variable.unit.as_str());
    let used: BTreeSet<&str> = used.filter(|unit| !unit.is_empty()).collect();
    used.into_iter().map(unit).collect()
}

fn unit(name: &str) -> String {
    let base = exponents(name).map_or_else(String::new, |exponents| {
        let parts = BASE
            .iter()
            .zip(exponents)
            .filter(|(_, exponent)| *exponent != 0);
        let parts: String = parts
            .map(|(base, exponent)| format!(" {base}=\"{exponent}\""))
            .collect();
        format!("<BaseUnit{parts}/>")
    });
    format!("    <Unit name=\"{}\">{base}</Unit>\n", escaped(name))
}

/// Attributes of causality and variability.
pub(super) fn kind(role: &Role) -> &'static str {
    match role {
        Role::Time => r#"causality="independent" variability="continuous""#,
        Role::Input => r#"causality="input""#,
        Role::State { output: true } => r#"causality="output" initial="exact""#,
        Role::State { output: false } => r#"causality="local" initial="exact""#,
        Role::Rate { .. } => r#"causality="local""#,
        Role::Parameter { .. } => r#"causality="parameter" variability="tunable""#,
    }
}

/// Attributes of its value, each preceded by a space; variables are counted from `first`.
pub(super) fn value(variable: &Variable, first: usize) -> String {
    let mut text = match &variable.role {
        Role::Time => String::new(),
        Role::Input | Role::State { .. } => r#" start="0""#.to_owned(),
        Role::Rate { state } => format!(r#" derivative="{}""#, first + state),
        Role::Parameter { value, bounds } => {
            let mut text = format!(r#" start="{value:?}""#);
            for (name, bound) in ["min", "max"]
                .iter()
                .zip(bounds)
                .filter(|(_, bound)| bound.is_finite())
            {
                let _ = write!(text, " {name}=\"{bound:?}\"");
            }
            text
        }
    };
    if !variable.unit.is_empty() {
        let _ = write!(text, " unit=\"{}\"", escaped(&variable.unit));
    }
    text
}

/// Positions of the outputs.
pub(super) fn outputs(variables: &[Variable]) -> Vec<usize> {
    places(variables, |role| {
        matches!(role, Role::State { output: true })
    })
}

/// Positions of the derivatives, in the order of the states. They alone are unknown at the start.
pub(super) fn rates(variables: &[Variable]) -> Vec<usize> {
    places(variables, |role| matches!(role, Role::Rate { .. }))
}

fn places(variables: &[Variable], of: impl Fn(&Role) -> bool) -> Vec<usize> {
    let places = (variables.iter().enumerate()).filter(|(_, variable)| of(&variable.role));
    places.map(|(k, _)| k).collect()
}

pub(super) fn escaped(text: &str) -> String {
    let text = text
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;");
    text.replace('"', "&quot;").replace(['\n', '\r', '\t'], " ")
}
