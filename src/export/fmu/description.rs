use std::collections::BTreeSet;
use std::fmt::Write;

use super::unit::{BASE, exponents};
use super::variables::{Role, Variable};
use crate::export::Portable;

/// The text of `modelDescription.xml`.
pub(super) fn description(
    model: &Portable,
    identifier: &str,
    token: &str,
    variables: &[Variable],
) -> String {
    let origin = model.provenance().to_string();
    let delays = super::delays(model);
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="{token}" description="{about}" generationTool="residyn {version}" variableNamingConvention="structured">
  <ModelExchange modelIdentifier="{identifier}" needsCompletedIntegratorStep="{delays}" canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="true" providesAdjointDerivatives="true"/>
  <CoSimulation modelIdentifier="{identifier}" canGetAndSetFMUState="true" canSerializeFMUState="true" canHandleVariableCommunicationStepSize="true"/>
  <UnitDefinitions>
{units}  </UnitDefinitions>
  <DefaultExperiment startTime="0" stopTime="5" stepSize="{step}"/>
  <ModelVariables>
{variables}  </ModelVariables>
  <ModelStructure>
{structure}  </ModelStructure>
  <Annotations>
    <Annotation type="residyn">{origin}</Annotation>
  </Annotations>
</fmiModelDescription>
"#,
        name = escaped(model.name()),
        about = escaped(&model.system.about),
        version = env!("CARGO_PKG_VERSION"),
        units = units(variables),
        step = model.step_s,
        variables = variables
            .iter()
            .enumerate()
            .map(|(k, v)| variable(k, v))
            .collect::<String>(),
        structure = structure(variables),
        origin = escaped(&origin),
    )
}

fn units(variables: &[Variable]) -> String {
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

fn variable(reference: usize, variable: &Variable) -> String {
    let role = match &variable.role {
        Role::Time => r#"causality="independent" variability="continuous""#.to_owned(),
        Role::Input => r#"causality="input" start="0""#.to_owned(),
        Role::State { output } => {
            let causality = if *output { "output" } else { "local" };
            format!(r#"causality="{causality}" initial="exact" start="0""#)
        }
        Role::Rate { state } => format!(r#"causality="local" derivative="{state}""#),
        Role::Parameter { value, bounds } => {
            let mut text =
                format!(r#"causality="parameter" variability="tunable" start="{value:?}""#);
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
    let unit = match variable.unit.as_str() {
        "" => String::new(),
        unit => format!(" unit=\"{}\"", escaped(unit)),
    };
    let (name, about) = (escaped(&variable.name), escaped(&variable.about));
    format!(
        "    <Float64 name=\"{name}\" valueReference=\"{reference}\" {role}{unit} description=\"{about}\"/>\n"
    )
}

/// Outputs, derivatives in the order of the states, and what follows from start values.
fn structure(variables: &[Variable]) -> String {
    let list = |element: &str, of: fn(&Role) -> bool| -> String {
        let places = variables
            .iter()
            .enumerate()
            .filter(|(_, variable)| of(&variable.role));
        places
            .map(|(k, _)| format!("    <{element} valueReference=\"{k}\"/>\n"))
            .collect()
    };
    let rate = |role: &Role| matches!(role, Role::Rate { .. });
    [
        list("Output", |role| {
            matches!(role, Role::State { output: true })
        }),
        list("ContinuousStateDerivative", rate),
        list("InitialUnknown", rate),
    ]
    .concat()
}

fn escaped(text: &str) -> String {
    let text = text
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;");
    text.replace('"', "&quot;").replace(['\n', '\r', '\t'], " ")
}
