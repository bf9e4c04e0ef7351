//! Isaac Lab: a configuration of actuators for each joint.

use std::fmt::Write;
use std::path::Path;

use super::{Block, Blocks, NO_CLIENT, number};
use crate::verify::Client;
use crate::{ExportError, ExportModel, File, Format};

pub(crate) const FORMAT: Format = Format {
    name: "isaaclab",
    about: "actuators of position-controlled joints, as Python for Isaac Lab",
    extension: "py",
    not_carried: Blocks::not_carried,
    files,
    client: Client::None(NO_CLIENT),
    tolerance: 0.0,
    robots: None,
};

/// Names of fields are those that 2.3 and 3.x both know.
const ABOUT: &str = "Actuators for Isaac Lab 2.3 to 3.x: ArticulationCfg(actuators=ACTUATORS, ...).\n\
    # Friction is in N m (N), as Isaac Sim 5.0 and later read it.";

const IMPORTS: &str = "from isaaclab.actuators import DelayedPDActuatorCfg, ImplicitActuatorCfg";

fn files(model: &ExportModel, path: &Path) -> Result<Vec<File>, ExportError> {
    let own = Blocks::of(model).map_err(|reason| model.refused("Isaac Lab actuators", reason))?;
    let head = own.head(model, ABOUT, IMPORTS);
    Ok(own.file(path, head, ["{", "}"], written))
}

/// A joint whose commands are late is driven by Isaac Lab, which can delay them, the others by the physics engine.
fn written(block: &Block) -> String {
    let is_late = block.delay_s > 0.0;
    let (class, limit) = match is_late {
        true => ("DelayedPDActuatorCfg", "effort_limit"),
        false => ("ImplicitActuatorCfg", "effort_limit_sim"),
    };
    let mut text = format!(
        "    {}: {class}(\n        joint_names_expr=[{}],\n",
        block.key(),
        block.pattern()
    );
    let mut field = |name: &str, value: String| {
        let _ = writeln!(text, "        {name}={value},");
    };
    field("stiffness", number(block.held.stiffness));
    field("damping", number(block.held.damping));
    if let Some(effort) = block.effort {
        field(limit, number(effort));
    }
    field("armature", number(block.armature));
    field("friction", number(block.dry_friction));
    field("dynamic_friction", number(block.dry_friction));
    field("viscous_friction", number(block.viscous_friction));
    if is_late {
        let steps = format!("steps({})", number(block.delay_s));
        field("min_delay", steps.clone());
        field("max_delay", steps);
    }
    text + "    ),\n"
}
