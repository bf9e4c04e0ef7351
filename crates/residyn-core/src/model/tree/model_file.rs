//! Writes the model file of a tree.

use std::collections::HashSet;
use std::fmt::Write;

use super::bodies_text::Bodies;
use toml_edit::DocumentMut;

use super::body::{Drivetrain, Joint, Tree};
use super::closed_form::ClosedForm;
use super::equations::Kind;
use super::formula::number;
use super::series::{LONGEST_CLOSED_FORM, rounded};
use crate::data;
use crate::model::like::of_names;
use crate::model::ready_drive::{hold, write_plain};
use crate::model::{Library, ReadyDrive};

/// The drives of a position loop: with an effort limit, and without.
const SERVO: &str = "position_servo";
const UNLIMITED_SERVO: &str = "position_loop";
/// The parameters of both that are stiffness and damping.
const GAINS: [&str; 2] = ["kp", "kd"];
/// The drive parameter that is the effort limit.
pub(super) const LIMIT: &str = "limit";

const ABOUT: &str = "equations derived from the description of a mechanism";

/// The text of a tree's model file: up to three joints as equations in closed form with base parameters, more
/// as bodies; damping, dry friction, rotors, springs and effort limits as effects.
///
/// Where position loops drive the joints, a few are written as bodies as well: their sums alone do not tell a rotor from
/// the link that turns with it, and that a body has to be physical does.
pub fn model_text(tree: &Tree) -> String {
    let is_in_closed_form = is_short(tree) && !has_servos(tree);
    let (equations, rotors) = if is_in_closed_form {
        let closed = ClosedForm::of(tree);
        (closed.text(), closed.rotors())
    } else {
        let armatures = tree.leaders().map(|(_, joint)| joint.drivetrain.armature);
        (Bodies(tree).text(), armatures.collect())
    };
    let declared = with_drives([head(tree), equations].concat(), tree);
    declared + &effects(tree, &rotors)
}

/// Whether it has equations in closed form.
pub(super) fn is_short(tree: &Tree) -> bool {
    let follows = |joint: &Joint| joint.follows.is_some();
    tree.joints.len() <= LONGEST_CLOSED_FORM && !tree.joints.iter().any(follows)
}

/// Whether a position loop drives some joint.
fn has_servos(tree: &Tree) -> bool {
    let has_servo = |joint: &Joint| joint.drivetrain.servo.is_some();
    tree.joints.iter().any(has_servo)
}

/// The text with the joints' drives, if some joint is not driven by a torque.
fn with_drives(text: String, tree: &Tree) -> String {
    if tree.drive.is_none() && !has_servos(tree) {
        return text;
    }
    let mut model: DocumentMut = text.parse().expect("what is written here is TOML");
    for (number, joint) in tree.leaders() {
        let Drivetrain { servo, effort, .. } = joint.drivetrain;
        let gains = servo
            .into_iter()
            .flat_map(|servo| GAINS.into_iter().zip([servo.stiffness, servo.damping]));
        let known: Vec<(&str, f64)> = gains.chain(effort.map(|limit| (LIMIT, limit))).collect();
        match drive_of(tree, joint) {
            Some(drive) => drive.write_into(&mut model, number, joint.slides, &known),
            None => write_plain(&mut model, number),
        }
        if servo.is_some_and(|servo| servo.is_known) {
            GAINS.iter().for_each(|gain| hold(&mut model, gain, number));
        }
    }
    model.to_string()
}

/// What drives a joint, unless a torque does.
fn drive_of(tree: &Tree, joint: &Joint) -> Option<ReadyDrive> {
    let Drivetrain { servo, effort, .. } = joint.drivetrain;
    let name = effort.map_or(UNLIMITED_SERVO, |_| SERVO);
    let own = || ReadyDrive::find(Library::drives(), name).expect("an embedded drive");
    tree.drive.clone().or_else(|| servo.map(|_| own()))
}

fn head(tree: &Tree) -> String {
    let mut text = "# In the frame of each joint k, whose z is its axis: m_k mass, mx_k.. mass times centre of mass, xx_k.. inertia\n\
        # tensor of what moves with it up to the next joint, J_k inertia of its rotor.\n"
        .to_owned();
    for (number, joint) in tree.leaders() {
        let does = if joint.slides { "slides" } else { "turns" };
        let _ = writeln!(
            text,
            "# joint {number} ({}) {does} {}: z is {}, x is {} of its frame",
            joint.name,
            joint.body,
            direction(&joint.axis),
            direction(&joint.across)
        );
    }
    for note in &tree.notes {
        let _ = writeln!(text, "# {note}");
    }
    let _ = write!(
        text,
        "\n[system]\nname = {}\nabout = {}\njoints = {}\n",
        quoted(&tree.name),
        quoted(ABOUT),
        tree.leaders().count()
    );
    let names: Vec<String> = tree
        .leaders()
        .map(|(_, joint)| quoted(&joint.name))
        .collect();
    // In MJCF, joints need not have names.
    if names.iter().collect::<HashSet<_>>().len() == names.len() {
        let _ = writeln!(text, "joint_names = [{}]", names.join(", "));
        text += &proposed_like(tree);
    }
    let slides: Vec<String> = tree
        .leaders()
        .filter(|(_, joint)| joint.slides)
        .map(|(number, _)| number.to_string())
        .collect();
    if !slides.is_empty() {
        let _ = writeln!(text, "prismatic = [{}]", slides.join(", "));
    }
    text
}

/// Which joints are built alike as their names say, as a line for the user to take: logs are to decide what they share only
/// where the user wants them to.
fn proposed_like(tree: &Tree) -> String {
    let names: Vec<String> = tree
        .leaders()
        .map(|(_, joint)| joint.name.clone())
        .collect();
    let groups = of_names(&names);
    let group = |group: &Vec<data::Joint>| {
        let quoted: Vec<String> = group.iter().map(|joint| quoted(&names[*joint])).collect();
        format!("[{}]", quoted.join(", "))
    };
    let groups: Vec<String> = groups.iter().map(group).collect();
    match groups.is_empty() {
        true => String::new(),
        false => format!(
            "# These joints look alike; without the # they share friction, rotors, gains and delays unless the logs contradict:\n\
             # like = [{}]\n",
            groups.join(", ")
        ),
    }
}

/// `zz_1`
pub(super) fn name(kind: Kind, joint: data::Joint) -> String {
    format!("{}_{joint}", kind.stem())
}

/// A TOML string.
pub(super) fn quoted(text: &str) -> String {
    toml_edit::Value::from(text).to_string()
}

/// The line that declares a parameter of a joint's body.
pub(super) fn parameter(
    kind: Kind,
    joint: data::Joint,
    value: f64,
    is_positive: bool,
    about: &str,
) -> String {
    format!(
        "{} = {{ value = {:?}, unit = \"{}\"{}, about = {} }}\n",
        name(kind, joint),
        rounded(value),
        unit(kind),
        if is_positive { ", positive = true" } else { "" },
        quoted(about)
    )
}

/// The line that declares gravity.
pub(super) fn gravity_parameter(tree: &Tree) -> String {
    let g = tree.gravity.norm();
    format!("g = {{ value = {g:?}, unit = \"m/s^2\", fixed = true }}\n")
}

fn unit(kind: Kind) -> &'static str {
    match kind {
        Kind::Tensor(..) | Kind::Rotor => "kg m^2",
        Kind::Moment(_) => "kg m",
        Kind::Mass => "kg",
    }
}

/// `(0, 0, 1)`, to six digits.
pub(super) fn direction(vector: &nalgebra::Vector3<f64>) -> String {
    let parts: Vec<String> = vector.iter().map(|part| number(short(*part))).collect();
    format!("({})", parts.join(", "))
}

/// To six digits; zero has no sign.
pub(super) fn short(value: f64) -> f64 {
    let short: f64 = format!("{value:.5e}")
        .parse()
        .expect("a printed number is a number");
    if short.abs() < 1e-12 { 0.0 } else { short }
}

/// Drivetrains as effects, with the rotor inertia (kg m^2 or kg) of each joint.
fn effects(tree: &Tree, rotors: &[f64]) -> String {
    let mut text = String::new();
    for (number, joint) in tree.leaders() {
        let mut effect = |name: &str, values: &[(&str, f64)]| {
            let _ = write!(text, "\n[[effect]]\nname = \"{name}\"\njoint = {number}\n");
            for (parameter, value) in values {
                let _ = writeln!(text, "{parameter} = {value:?}");
            }
        };
        if joint.drivetrain.damping > 0.0 {
            effect("viscous_friction", &[("b", joint.drivetrain.damping)]);
        }
        if joint.drivetrain.friction > 0.0 {
            effect("coulomb_friction", &[("F_c", joint.drivetrain.friction)]);
        }
        if let Some(spring) = joint.drivetrain.spring {
            effect(
                "joint_spring",
                &[("k", spring.stiffness), ("q_0", spring.rest)],
            );
        }
        if rotors[number] > 0.0 {
            effect("rotor_inertia", &[("J", rounded(rotors[number]))]);
        }
        let in_drive = drive_of(tree, joint).is_some_and(|drive| drive.has(LIMIT));
        if let Some(effort) = joint.drivetrain.effort.filter(|_| !in_drive) {
            effect("actuator_saturation", &[("m", effort)]);
            text += "fixed = true\n";
        }
    }
    text
}
