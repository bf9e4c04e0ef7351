use super::{Standard, format};
use crate::Format;

pub(crate) const FORMAT: Format = format(
    "fmu2",
    "FMI 2.0 for model exchange and co-simulation, physical parameters tunable",
    |model, path| STANDARD.files(model, path),
);

const STANDARD: Standard = Standard {
    source: ("fmi2.c", include_str!("fmi2.c")),
    description: include_str!("fmi2.xml"),
    build: None,
    first: 1,
    variable: "    <ScalarVariable name=\"@NAME@\" valueReference=\"@REFERENCE@\" @KIND@ description=\"@ABOUT@\"><Real@VALUE@/></ScalarVariable>\n",
    unknowns: ["<Unknown index=\"@PLACE@\"/>"; 3],
    platform: || {
        let system = match std::env::consts::OS {
            "macos" => "darwin",
            "windows" => "win",
            other => other,
        };
        format!("{system}{}", usize::BITS)
    },
};
