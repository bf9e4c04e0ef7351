use super::variables::Variable;
use super::xml::{escaped, kind, outputs, rates, units, value};
use super::{Fmu, Standard, format};
use crate::formats::Format;

pub(in crate::formats) const FORMAT: Format = format(
    "fmu2",
    "FMI 2.0 for model exchange and co-simulation, physical parameters tunable",
    |model, path| STANDARD.files(model, path),
);

const STANDARD: Standard = Standard {
    source: ("fmi2.c", include_str!("fmi2.c")),
    platform: || {
        let system = match std::env::consts::OS {
            "macos" => "darwin",
            "windows" => "win",
            other => other,
        };
        format!("{system}{}", usize::BITS)
    },
    descriptions: |fmu| vec![("modelDescription.xml", description(fmu))],
};

fn description(fmu: &Fmu) -> String {
    let Fmu {
        model,
        identifier,
        token,
        variables,
    } = fmu;
    let origin = model.provenance().to_string();
    let unneeded = !super::delays(model);
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{token}" description="{about}" generationTool="residyn {version}" variableNamingConvention="structured" numberOfEventIndicators="0">
  <ModelExchange modelIdentifier="{identifier}" completedIntegratorStepNotNeeded="{unneeded}" canNotUseMemoryManagementFunctions="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true">
    <SourceFiles><File name="{source}"/></SourceFiles>
  </ModelExchange>
  <CoSimulation modelIdentifier="{identifier}" canHandleVariableCommunicationStepSize="true" canNotUseMemoryManagementFunctions="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true">
    <SourceFiles><File name="{source}"/></SourceFiles>
  </CoSimulation>
  <UnitDefinitions>
{units}  </UnitDefinitions>
  <DefaultExperiment startTime="0" stopTime="5" stepSize="{step}"/>
  <VendorAnnotations>
    <Tool name="residyn"><origin>{origin}</origin></Tool>
  </VendorAnnotations>
  <ModelVariables>
{list}  </ModelVariables>
  <ModelStructure>
{outputs}{rates}{unknowns}  </ModelStructure>
</fmiModelDescription>
"#,
        name = escaped(model.name()),
        about = escaped(&model.system.about),
        version = env!("CARGO_PKG_VERSION"),
        source = STANDARD.source.0,
        units = units(variables),
        step = model.step_s,
        list = (variables.iter().enumerate().map(variable)).collect::<String>(),
        outputs = unknowns("Outputs", &outputs(variables)),
        rates = unknowns("Derivatives", &rates(variables)),
        unknowns = unknowns("InitialUnknowns", &rates(variables)),
        origin = escaped(&origin),
    )
}

fn variable((reference, variable): (usize, &Variable)) -> String {
    format!(
        "    <ScalarVariable name=\"{name}\" valueReference=\"{reference}\" {kind} description=\"{about}\"><Real{value}/></ScalarVariable>\n",
        name = escaped(&variable.name),
        kind = kind(&variable.role),
        about = escaped(&variable.about),
        value = value(variable, 1),
    )
}

/// Variables are counted from 1 here.
fn unknowns(element: &str, places: &[usize]) -> String {
    let unknowns: String = (places.iter())
        .map(|place| format!("<Unknown index=\"{}\"/>", place + 1))
        .collect();
    format!("    <{element}>{unknowns}</{element}>\n")
}
