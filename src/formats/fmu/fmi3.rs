use super::variables::Variable;
use super::xml::{escaped, kind, outputs, rates, units, value};
use super::{Fmu, Standard, format};
use crate::formats::Format;

pub(in crate::formats) const FORMAT: Format = format(
    "fmu",
    "FMI 3.0 for model exchange and co-simulation, physical parameters tunable",
    |model, path| STANDARD.files(model, path),
);

const STANDARD: Standard = Standard {
    source: ("fmi3.c", include_str!("fmi3.c")),
    platform: || {
        let system = match std::env::consts::OS {
            "macos" => "darwin",
            other => other,
        };
        format!("{}-{system}", std::env::consts::ARCH)
    },
    descriptions: |fmu| {
        let build = include_str!("buildDescription.xml");
        vec![
            ("modelDescription.xml", description(fmu)),
            (
                "sources/buildDescription.xml",
                build.replace("@IDENTIFIER@", &fmu.identifier),
            ),
        ]
    },
};

fn description(fmu: &Fmu) -> String {
    let Fmu {
        model,
        identifier,
        token,
        variables,
    } = fmu;
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
{list}  </ModelVariables>
  <ModelStructure>
{outputs}{rates}{unknowns}  </ModelStructure>
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
        list = (variables.iter().enumerate().map(variable)).collect::<String>(),
        outputs = elements("Output", &outputs(variables)),
        rates = elements("ContinuousStateDerivative", &rates(variables)),
        unknowns = elements("InitialUnknown", &rates(variables)),
        origin = escaped(&origin),
    )
}

fn variable((reference, variable): (usize, &Variable)) -> String {
    format!(
        "    <Float64 name=\"{name}\" valueReference=\"{reference}\" {kind}{value} description=\"{about}\"/>\n",
        name = escaped(&variable.name),
        kind = kind(&variable.role),
        value = value(variable, 0),
        about = escaped(&variable.about),
    )
}

fn elements(name: &str, references: &[usize]) -> String {
    let references = references.iter();
    references
        .map(|k| format!("    <{name} valueReference=\"{k}\"/>\n"))
        .collect()
}
