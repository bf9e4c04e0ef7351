//! The model description of an FMU.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::variables::{Role, Variable};
use super::{Fmu, Standard};
use crate::template::filled;
use crate::xml::escaped;
use residyn_core::expr::{BASE, Unit};

impl Standard {
    /// The description of a unit: the template of this version, filled.
    pub(super) fn describe(&self, fmu: &Fmu) -> String {
        let Fmu {
            model, variables, ..
        } = fmu;
        let outputs = places(variables, |role| {
            matches!(role, Role::State { output: true, .. })
        });
        // Only the rates are unknown at the start.
        let rates = places(variables, |role| matches!(role, Role::Rate { .. }));
        let [output, rate, unknown] = self.unknowns;
        let all = variables.iter().enumerate();
        let all: String = all.map(|(k, one)| self.variable(k, one)).collect();
        let remembers = super::delays(model);
        filled(
            self.description,
            &[
                ("IDENTIFIER", &fmu.identifier),
                ("TOKEN", &fmu.token),
                ("VERSION", &env!("CARGO_PKG_VERSION")),
                ("REMEMBERS", &remembers),
                ("FORGETS", &!remembers),
                ("STEP", &model.step_s),
                ("OUTPUTS", &self.each(output, &outputs)),
                ("RATES", &self.each(rate, &rates)),
                ("UNKNOWNS", &self.each(unknown, &rates)),
                ("UNITS", &units(variables)),
                ("VARIABLES", &all),
                ("NAME", &escaped(model.name())),
                ("ABOUT", &escaped(&model.system.about)),
                ("ORIGIN", &escaped(&model.provenance().to_string())),
            ],
        )
    }

    fn variable(&self, reference: usize, variable: &Variable) -> String {
        filled(
            self.variable,
            &[
                ("REFERENCE", &reference),
                ("KIND", &kind(&variable.role)),
                ("VALUE", &value(variable, self.first)),
                ("NAME", &escaped(&variable.name)),
                ("ABOUT", &escaped(&variable.about)),
            ],
        )
    }

    /// One element for each variable at these places.
    fn each(&self, element: &str, places: &[usize]) -> String {
        let elements = places
            .iter()
            .map(|k| filled(element, &[("PLACE", &(self.first + k))]));
        elements.collect()
    }
}

fn places(variables: &[Variable], of: impl Fn(&Role) -> bool) -> Vec<usize> {
    let places = (variables.iter().enumerate()).filter(|(_, variable)| of(&variable.role));
    places.map(|(k, _)| k).collect()
}

/// `Unit` elements of all units of the variables.
fn units(variables: &[Variable]) -> String {
    let used = variables.iter().map(|variable| variable.unit.as_str());
    let used: BTreeSet<&str> = used.filter(|unit| !unit.is_empty()).collect();
    used.into_iter().map(unit).collect()
}

fn unit(name: &str) -> String {
    let base = Unit::parse(name).map_or_else(String::new, |unit| {
        let parts = BASE
            .iter()
            .zip(unit.exponents())
            .filter(|(_, exponent)| *exponent != 0);
        let parts: String = parts
            .map(|(base, exponent)| format!(" {base}=\"{exponent}\""))
            .collect();
        format!("<BaseUnit{parts}/>")
    });
    format!("    <Unit name=\"{}\">{base}</Unit>\n", escaped(name))
}

/// Attributes of causality and variability.
fn kind(role: &Role) -> &'static str {
    match role {
        Role::Time => r#"causality="independent" variability="continuous""#,
        Role::Input => r#"causality="input""#,
        Role::State { output: true, .. } => r#"causality="output" initial="exact""#,
        Role::State { output: false, .. } => r#"causality="local" initial="exact""#,
        Role::Rate { .. } => r#"causality="local""#,
        Role::Parameter { .. } => r#"causality="parameter" variability="tunable""#,
    }
}

/// Attributes of a variable's value, each preceded by a space; variables are counted from `first`.
fn value(variable: &Variable, first: usize) -> String {
    let mut text = match &variable.role {
        Role::Time => String::new(),
        Role::Input => r#" start="0""#.to_owned(),
        Role::State { start, .. } => format!(r#" start="{start}""#),
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
