//! Writes the mechanism of a model.

use std::fmt::Write;
use std::path::Path;

use super::drive::{actuators, timing_not_carried};
use super::read::read_mjcf;
use super::rewrite::{inertial, rewrite};
use super::transmission::{joints, not_carried as of_motors, numeric, tendons};
use crate::robot::mechanism::{
    Link, Mechanism, file, friction_widths, head, mujoco_step_s, numbers, option,
};
use crate::verify::{Client, PythonClient};
use crate::xml::escaped;
use crate::{ExportError, ExportModel, File, Format, RobotReader};

pub(crate) const FORMAT: Format = Format {
    name: "mjcf",
    about: "a mechanism with its friction, springs and drives, for MuJoCo",
    extension: "xml",
    not_carried,
    files,
    client: Client::Python(PythonClient {
        name: "mjcf.py",
        script: include_str!("../../../../docs/clients/mjcf.py"),
        packages: "mujoco numpy",
    }),
    tolerance: 1e-9,
    robots: Some(RobotReader {
        about: "up to 40 hinge or slide joints",
        read: read_mjcf,
        root: "mujoco",
        effects: &["viscous_friction", "coulomb_friction", "rotor_inertia"],
        rewrite,
    }),
};

fn not_carried(model: &ExportModel) -> Vec<String> {
    let Ok(mechanism) = Mechanism::of(model) else {
        return Vec::new();
    };
    let timing = timing_not_carried(model, &mechanism);
    let motors = of_motors(&mechanism);
    [mechanism.not_carried, timing, motors].concat()
}

fn files(model: &ExportModel, path: &Path) -> Result<Vec<File>, ExportError> {
    file(model, path, "MJCF", text)
}

fn text(model: &ExportModel, mechanism: &Mechanism) -> String {
    let mut text = head(model);
    let _ = write!(
        text,
        "<mujoco model=\"{}\">\n  <compiler angle=\"radian\"/>\n  {}\n{}  <custom>\n    \
         <!-- Velocities over which dry friction reverses in the exported model. -->\n    \
         <numeric name=\"dry_friction_width\" data=\"{}\"/>\n{}  </custom>\n  <worldbody>\n",
        escaped(model.name()),
        option(model, mechanism),
        friction_default(model, mechanism),
        friction_widths(model),
        numeric(mechanism)
    );
    let links = mechanism.links();
    for k in mechanism.carried_by(None) {
        text += &body(mechanism, &links, k, 2);
    }
    text += "  </worldbody>\n";
    text += &tendons(mechanism);
    text + &actuators(model, mechanism) + "</mujoco>\n"
}

/// A body with those that it carries, `depth` elements deep.
fn body(mechanism: &Mechanism, links: &[Link], k: usize, depth: usize) -> String {
    let indent = "  ".repeat(depth);
    let (joint, link) = (&mechanism.joints[k], &links[k]);
    let carried: Vec<usize> = mechanism.carried_by(Some(k)).collect();
    let next = carried.first().map(|next| &links[*next]);
    let end = next.map_or(link.centre, |next| next.pose.origin);
    let shape = match end.norm() {
        0.0 => "type=\"sphere\" size=\"0.04\"".to_owned(),
        length => {
            let ends = numbers([0.0; 3].iter().chain(&end));
            format!(
                "type=\"capsule\" size=\"{}\" fromto=\"{ends}\"",
                numbers([0.05 * length])
            )
        }
    };
    let own = format!(
        "{indent}<body name=\"{}\" pos=\"{}\" xyaxes=\"{}\">\n\
         {}\
         {indent}  {}\n\
         {indent}  <geom {shape} mass=\"0\" contype=\"0\" conaffinity=\"0\"/>\n",
        joint.body,
        numbers(&link.pose.origin),
        numbers(link.pose.rotation.columns(0, 2).iter()),
        joints(mechanism, k, &numbers(&link.axis), &indent),
        inertial(&link.centre, link.mass, &link.tensor),
    );
    let others = carried
        .iter()
        .map(|k| body(mechanism, links, *k, depth + 1));
    own + &others.collect::<String>() + &indent + "</body>\n"
}

/// Dry friction as stiff as the step allows, which is twice its length: with MuJoCo's default of 20 ms, joints creep where
/// they should stick.
fn friction_default(model: &ExportModel, mechanism: &Mechanism) -> String {
    let mut joints = mechanism.joints.iter();
    if !joints.any(|joint| joint.drivetrain.friction > 0.0) {
        return String::new();
    }
    let stiffest = numbers([2.0 * mujoco_step_s(model), 1.0]);
    format!("  <default>\n    <joint solreffriction=\"{stiffest}\"/>\n  </default>\n")
}

/// Attributes whose values differ from the format's defaults.
pub(super) fn attributes(values: &[(&str, f64, f64)]) -> String {
    #[allow(clippy::float_cmp)] // compared as set
    let given = values.iter().filter(|(_, value, default)| value != default);
    given
        .map(|(key, value, _)| format!(" {key}=\"{value}\""))
        .collect()
}
