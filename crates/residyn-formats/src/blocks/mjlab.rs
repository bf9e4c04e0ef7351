//! mjlab: a configuration of a MuJoCo actuator for each joint, and event terms.

use super::block::Block;
use super::event::Event;
use super::event::Operation::Replaces;
use super::quantity::Quantity;
use super::{NO_CLIENT, Simulator};
use crate::Format;
use crate::verify::Client;

pub(crate) const FORMAT: Format = Format {
    name: "mjlab",
    about: "actuators of position-controlled joints and their ranges, as Python for mjlab",
    extension: "py",
    not_carried: |model| SIMULATOR.not_carried(model),
    files: |model, path| SIMULATOR.files(model, path),
    client: Client::None(NO_CLIENT),
    tolerance: 0.0,
    robots: None,
};

/// Delays and viscous friction are fields of every actuator since 1.3.
const SIMULATOR: Simulator = Simulator {
    what: "mjlab actuators",
    about: "Actuators for mjlab 1.3 and later: EntityArticulationInfoCfg(actuators=ACTUATORS, ...).",
    imports: "from mjlab.actuator import BuiltinPositionActuatorCfg",
    imports_of_events: "from mjlab.envs.mdp import dr\n\
        from mjlab.managers.event_manager import EventTermCfg\n\
        from mjlab.managers.scene_entity_config import SceneEntityCfg\n",
    // Actuators bear the names of their joints.
    event: "def event(function, operation, joint, **ranges):\n    \
        asset = SceneEntityCfg(\"robot\", joint_names=(joint,), actuator_names=[joint])\n    \
        return EventTermCfg(func=function, mode=\"startup\", params={\"asset_cfg\": asset, \"operation\": operation} | ranges)\n\n\n",
    brackets: ["(", ")"],
    opening,
    fields,
    events,
};

fn opening(block: &Block) -> String {
    let names = block.pattern();
    format!("BuiltinPositionActuatorCfg(\n        target_names_expr=({names},),")
}

/// Without the last two fields of a delay, a new one would be drawn in every step.
fn fields(block: &Block) -> Vec<(&'static str, String)> {
    let mut fields = block.fields(&[
        ("stiffness", Quantity::Stiffness),
        ("damping", Quantity::Damping),
        ("effort_limit", Quantity::Effort),
        ("armature", Quantity::Armature),
        ("frictionloss", Quantity::DryFriction),
        ("viscous_damping", Quantity::ViscousFriction),
    ]);
    let delay = block.delay().into_iter().flatten();
    fields.extend(["delay_min_lag", "delay_max_lag"].into_iter().zip(delay));
    if block.is_late() && block.range(Quantity::Delay).is_some() {
        fields.push(("delay_update_period", "10**9".into()));
        fields.push(("delay_per_env_phase", "False".into()));
    }
    fields
}

fn events(_: &Block) -> Vec<Event> {
    vec![
        Event {
            about: "gains",
            function: "dr.pd_gains",
            operation: Replaces,
            ranges: &[
                ("kp_range", Quantity::Stiffness),
                ("kd_range", Quantity::Damping),
            ],
        },
        Event {
            about: "limit",
            function: "dr.effort_limits",
            operation: Replaces,
            ranges: &[("effort_limit_range", Quantity::Effort)],
        },
        Event {
            about: "armature",
            function: "dr.joint_armature",
            operation: Replaces,
            ranges: &[("ranges", Quantity::Armature)],
        },
        Event {
            about: "dry friction",
            function: "dr.joint_friction",
            operation: Replaces,
            ranges: &[("ranges", Quantity::DryFriction)],
        },
        Event {
            about: "viscous friction",
            function: "dr.joint_damping",
            operation: Replaces,
            ranges: &[("ranges", Quantity::ViscousFriction)],
        },
    ]
}
