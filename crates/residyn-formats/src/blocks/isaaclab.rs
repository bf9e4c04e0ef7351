//! Isaac Lab: a configuration of actuators for each joint, and event terms.

use super::block::Block;
use super::event::Event;
use super::event::Operation::{Multiplies, Replaces};
use super::quantity::Quantity;
use super::{NO_CLIENT, Simulator};
use crate::Format;
use crate::verify::Client;

pub(crate) const FORMAT: Format = Format {
    name: "isaaclab",
    about: "actuators of position-controlled joints and their ranges, as Python for Isaac Lab",
    extension: "py",
    not_carried: |model| SIMULATOR.not_carried(model),
    files: |model, path| SIMULATOR.files(model, path),
    client: Client::None(NO_CLIENT),
    tolerance: 0.0,
    robots: None,
};

/// Names of fields are those that 2.3 and 3.x both know.
const SIMULATOR: Simulator = Simulator {
    what: "Isaac Lab actuators",
    about: "Actuators for Isaac Lab 2.3 to 3.x: ArticulationCfg(actuators=ACTUATORS, ...).\n\
        # Friction is in N m (N), as Isaac Sim 5.0 and later read it.",
    imports: "from isaaclab.actuators import DelayedPDActuatorCfg, ImplicitActuatorCfg",
    imports_of_events: "from isaaclab.envs import mdp\n\
        from isaaclab.managers import EventTermCfg, SceneEntityCfg\n",
    event: "def event(function, operation, joint, **ranges):\n    \
        asset = SceneEntityCfg(\"robot\", joint_names=[joint])\n    \
        return EventTermCfg(func=function, mode=\"startup\", params={\"asset_cfg\": asset, \"operation\": operation} | ranges)\n\n\n",
    brackets: ["{", "}"],
    opening,
    fields,
    events,
};

/// A joint whose commands are late is driven by Isaac Lab, which can delay them, the others by the physics engine.
fn opening(block: &Block) -> String {
    let class = match block.is_late() {
        true => "DelayedPDActuatorCfg",
        false => "ImplicitActuatorCfg",
    };
    let names = block.pattern();
    format!(
        "{}: {class}(\n        joint_names_expr=[{names}],",
        block.key()
    )
}

/// The delay is drawn anew at each reset.
fn fields(block: &Block) -> Vec<(&'static str, String)> {
    let limit = match block.is_late() {
        true => "effort_limit",
        false => "effort_limit_sim",
    };
    let mut fields = block.fields(&[
        ("stiffness", Quantity::Stiffness),
        ("damping", Quantity::Damping),
        (limit, Quantity::Effort),
        ("armature", Quantity::Armature),
        ("friction", Quantity::DryFriction),
        ("dynamic_friction", Quantity::DryFriction),
        ("viscous_friction", Quantity::ViscousFriction),
    ]);
    let delay = block.delay().into_iter().flatten();
    fields.extend(["min_delay", "max_delay"].into_iter().zip(delay));
    fields
}

/// One range of friction is for its dry and its viscous part alike, so it cannot be in units of either: it is a factor, from
/// the interval of dry friction where there is one.
fn events(block: &Block) -> Vec<Event> {
    let friction: &[_] = match block.range(Quantity::DryFriction) {
        Some(_) => &[("friction_distribution_params", Quantity::DryFriction)],
        None => &[("friction_distribution_params", Quantity::ViscousFriction)],
    };
    vec![
        Event {
            about: "gains",
            function: "mdp.randomize_actuator_gains",
            operation: Replaces,
            ranges: &[
                ("stiffness_distribution_params", Quantity::Stiffness),
                ("damping_distribution_params", Quantity::Damping),
            ],
        },
        Event {
            about: "armature",
            function: "mdp.randomize_joint_parameters",
            operation: Replaces,
            ranges: &[("armature_distribution_params", Quantity::Armature)],
        },
        Event {
            about: "friction",
            function: "mdp.randomize_joint_parameters",
            operation: Multiplies,
            ranges: friction,
        },
    ]
}
