use super::{Standard, format};
use crate::Format;

pub(crate) const FORMAT: Format = format(
    "fmu",
    "FMI 3.0 for model exchange and co-simulation, physical parameters tunable",
    |model, path| STANDARD.files(model, path),
);

const STANDARD: Standard = Standard {
    source: ("fmi3.c", include_str!("fmi3.c")),
    description: include_str!("fmi3.xml"),
    build: Some(include_str!("buildDescription.xml")),
    first: 0,
    variable: "    <Float64 name=\"@NAME@\" valueReference=\"@REFERENCE@\" @KIND@@VALUE@ description=\"@ABOUT@\"/>\n",
    unknowns: [
        "    <Output valueReference=\"@PLACE@\"/>\n",
        "    <ContinuousStateDerivative valueReference=\"@PLACE@\"/>\n",
        "    <InitialUnknown valueReference=\"@PLACE@\"/>\n",
    ],
    platform: || {
        let system = match std::env::consts::OS {
            "macos" => "darwin",
            other => other,
        };
        format!("{}-{system}", std::env::consts::ARCH)
    },
};
