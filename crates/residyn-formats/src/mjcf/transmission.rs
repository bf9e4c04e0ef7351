//! Joints, and motors behind transmissions: a motor's joint with its rotor, and on the same axis a joint by which the link leads it.

use super::write::attributes;
use crate::robot::mechanism::{Mechanism, numbers};
use crate::robot::powertrain::{Motor, Passes};
use residyn_core::model::tree::{Drivetrain, Joint};

/// What of the motors behind transmissions is written otherwise.
pub(super) fn not_carried(mechanism: &Mechanism) -> Vec<String> {
    let mut lost = Vec::new();
    for ((joint, drive), motor) in
        (mechanism.joints.iter().zip(&mechanism.drives)).zip(&mechanism.motors)
    {
        let Some(motor) = motor else { continue };
        let mut lost = |is_there: bool, what: &str| {
            if is_there {
                lost.push(format!("{what} of {}", joint.name));
            }
        };
        lost(joint.drivetrain.armature > 0.0, "the rotor on the link");
        let reads = drive.bias[1] != 0.0 || drive.bias[2] != 0.0;
        lost(
            reads && !motor.has_sensor,
            "a loop on the link's side: the drive reads the motor",
        );
    }
    lost
}

/// The joint of a body, or both joints of one whose motor stands behind a transmission.
pub(super) fn joints(mechanism: &Mechanism, k: usize, axis: &str, indent: &str) -> String {
    let joint = &mechanism.joints[k];
    let kind = if joint.slides { "slide" } else { "hinge" };
    let element = |name: &str, own: &str| {
        format!("{indent}  <joint name=\"{name}\" type=\"{kind}\" axis=\"{axis}\"{own}/>\n")
    };
    let Some(motor) = &mechanism.motors[k] else {
        return element(&joint.name, &of_drivetrain(&joint.drivetrain));
    };
    let drivetrain = Drivetrain {
        armature: motor.inertia,
        spring: None,
        ..with_friction(joint.drivetrain, motor.has_friction)
    };
    let passed = match motor.passes {
        Passes::Spring { stiffness, damping } => {
            attributes(&[("damping", damping, 0.0), ("stiffness", stiffness, 0.0)])
        }
        Passes::Play(play) => format!(
            " limited=\"true\" range=\"{}\"",
            numbers([-0.5 * play, 0.5 * play])
        ),
    };
    element(&joint.name, &of_drivetrain(&drivetrain)) + &element(&twist(&joint.name), &passed)
}

/// The joint by which a link leads its motor.
fn twist(joint: &str) -> String {
    format!("{joint}_twist")
}

/// The drivetrain with its friction, or without any.
fn with_friction(own: Drivetrain, has_friction: bool) -> Drivetrain {
    match has_friction {
        true => own,
        false => Drivetrain {
            damping: 0.0,
            friction: 0.0,
            ..own
        },
    }
}

/// Attributes of a joint's drivetrain.
fn of_drivetrain(own: &Drivetrain) -> String {
    let spring = own
        .spring
        .map_or([0.0, 0.0], |spring| [spring.stiffness, spring.rest]);
    attributes(&[
        ("damping", own.damping, 0.0),
        ("frictionloss", own.friction, 0.0),
        ("armature", own.armature, 0.0),
        ("stiffness", spring[0], 0.0),
        ("springref", spring[1], 0.0),
    ])
}

/// What acts on links behind transmissions, as tendons along both joints: springs, and friction unless it acts on the motor.
pub(super) fn tendons(mechanism: &Mechanism) -> String {
    let all = mechanism.joints.iter().zip(&mechanism.motors);
    let tendon = |(joint, motor): (&Joint, &Option<Motor>)| {
        let motor = motor.as_ref()?;
        let own = with_friction(joint.drivetrain, !motor.has_friction);
        let spring = own
            .spring
            .map_or([0.0, 0.0], |spring| [spring.stiffness, spring.rest]);
        let acts = attributes(&[
            ("damping", own.damping, 0.0),
            ("frictionloss", own.friction, 0.0),
            ("stiffness", spring[0], 0.0),
        ]);
        let rest = match spring[0] == 0.0 {
            true => String::new(),
            false => format!(" springlength=\"{}\"", numbers([spring[1]])),
        };
        let name = &joint.name;
        (!acts.is_empty()).then(|| {
            format!(
                "    <fixed name=\"{name}_link\"{acts}{rest}>\n      <joint joint=\"{name}\" coef=\"1\"/>\n      \
                 <joint joint=\"{}\" coef=\"1\"/>\n    </fixed>\n",
                twist(name)
            )
        })
    };
    let tendons: String = all.filter_map(tendon).collect();
    match tendons.is_empty() {
        true => tendons,
        false => format!("  <tendon>\n{tendons}  </tendon>\n"),
    }
}

/// For readers of the model's states: for each joint whether its angle is that of the motor (1), of the link behind a transmission
/// (0), or of both (-1), and the place of its twist among the states.
pub(super) fn numeric(mechanism: &Mechanism) -> String {
    if mechanism.motors.iter().all(Option::is_none) {
        return String::new();
    }
    let of_joint = |motor: &Option<Motor>| match motor {
        None => [-1.0, -1.0],
        Some(motor) => [f64::from(u8::from(motor.has_sensor)), motor.state as f64],
    };
    let data: Vec<f64> = mechanism.motors.iter().flat_map(of_joint).collect();
    format!(
        "    <!-- For each joint: whether its angle in the exported model is that of the motor (1), of the link (0), or of both \
         (-1), and the place of its twist among the states. -->\n    <numeric name=\"transmissions\" data=\"{}\"/>\n",
        numbers(data)
    )
}
