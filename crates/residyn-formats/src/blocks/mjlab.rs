//! mjlab: a configuration of a MuJoCo actuator for each joint.

use std::fmt::Write;
use std::path::Path;

use super::{Block, Blocks, NO_CLIENT, number};
use crate::verify::Client;
use crate::{ExportError, ExportModel, File, Format};

pub(crate) const FORMAT: Format = Format {
    name: "mjlab",
    about: "actuators of position-controlled joints, as Python for mjlab",
    extension: "py",
    not_carried: Blocks::not_carried,
    files,
    client: Client::None(NO_CLIENT),
    tolerance: 0.0,
    robots: None,
};

/// Delays and viscous friction are fields of every actuator since 1.3.
const ABOUT: &str =
    "Actuators for mjlab 1.3 and later: EntityArticulationInfoCfg(actuators=ACTUATORS, ...).";

const IMPORTS: &str = "from mjlab.actuator import BuiltinPositionActuatorCfg";

fn files(model: &ExportModel, path: &Path) -> Result<Vec<File>, ExportError> {
    let own = Blocks::of(model).map_err(|reason| model.refused("mjlab actuators", reason))?;
    let head = own.head(model, ABOUT, IMPORTS);
    Ok(own.file(path, head, ["(", ")"], written))
}

fn written(block: &Block) -> String {
    let mut text = format!(
        "    BuiltinPositionActuatorCfg(\n        target_names_expr=({},),\n",
        block.pattern()
    );
    let mut field = |name: &str, value: String| {
        let _ = writeln!(text, "        {name}={value},");
    };
    field("stiffness", number(block.held.stiffness));
    field("damping", number(block.held.damping));
    if let Some(effort) = block.effort {
        field("effort_limit", number(effort));
    }
    field("armature", number(block.armature));
    field("frictionloss", number(block.dry_friction));
    field("viscous_damping", number(block.viscous_friction));
    if block.delay_s > 0.0 {
        let steps = format!("steps({})", number(block.delay_s));
        field("delay_min_lag", steps.clone());
        field("delay_max_lag", steps);
    }
    text + "    ),\n"
}
