//! Writes the mechanism of a model.

use std::fmt::Write;
use std::path::Path;

use nalgebra::Rotation3;

use super::read::{GRAVITY, read_urdf};
use super::rewrite::{inertia, rewrite};
use crate::robot::mechanism::{Link, Mechanism, file, friction_widths, head, numbers, option};
use crate::verify::{Client, PythonClient};
use crate::xml::escaped;
use crate::{ExportError, ExportModel, File, Format, RobotReader};
use residyn_core::model::tree::Joint;

pub(crate) const FORMAT: Format = Format {
    name: "urdf",
    about: "a mechanism with damping, dry friction and limits of the drives",
    extension: "urdf",
    not_carried,
    files,
    client: Client::Python(PythonClient {
        name: "urdf.py",
        script: include_str!("../../../../docs/clients/urdf.py"),
        packages: "mujoco numpy",
    }),
    tolerance: 1e-9,
    robots: Some(RobotReader {
        about: "up to 40 revolute, continuous or prismatic joints",
        read: read_urdf,
        root: "robot",
        effects: &["viscous_friction", "coulomb_friction"],
        rewrite,
    }),
};

/// Limits that the format requires of sliding joints: m, m/s and N.
const NO_LIMIT: f64 = 1e6;

fn not_carried(model: &ExportModel) -> Vec<String> {
    let Ok(mechanism) = Mechanism::of(model) else {
        return Vec::new();
    };
    let mut lost = mechanism.not_carried;
    #[allow(clippy::float_cmp)] // compared as written
    if mechanism.gravity != GRAVITY {
        lost.push(format!(
            "gravity of {} m/s^2: only MuJoCo reads it",
            mechanism.gravity
        ));
    }
    for (k, (joint, drive)) in mechanism.joints.iter().zip(&mechanism.drives).enumerate() {
        let number = k + 1;
        let mut lost = |is_there: bool, what: &str| {
            if is_there {
                lost.push(format!("{what} of joint {number}"));
            }
        };
        if let Some(motor) = &mechanism.motors[k] {
            lost(true, &motor.said);
        }
        lost(joint.drivetrain.armature > 0.0, "the rotor's inertia");
        lost(joint.drivetrain.spring.is_some(), "the spring");
        lost(drive.delay.is_some(), "the drive's delay");
        lost(drive.lag.is_some(), "the drive's lag");
        lost(drive.bias != [0.0; 3], "what the drive adds to its command");
        #[allow(clippy::float_cmp)] // compared as set
        lost(drive.gain != 1.0, "the drive's gain");
    }
    lost
}

fn files(model: &ExportModel, path: &Path) -> Result<Vec<File>, ExportError> {
    file(model, path, "URDF", text)
}

fn text(model: &ExportModel, mechanism: &Mechanism) -> String {
    let mut text = head(model);
    let _ = write!(
        text,
        "<robot name=\"{}\">\n  <mujoco>\n  {}\n  </mujoco>\n  \
         <!-- Velocities over which dry friction reverses in the exported model. -->\n  \
         <residyn dry_friction_width=\"{}\"/>\n  <link name=\"base\"/>\n",
        escaped(model.name()),
        option(model, mechanism),
        friction_widths(model)
    );
    for ((joint, link), drive) in mechanism
        .joints
        .iter()
        .zip(mechanism.links())
        .zip(&mechanism.drives)
    {
        let parent = (joint.parent).map_or("base", |parent| &mechanism.joints[parent].body);
        text += &of_link(&joint.body, &link);
        text += &of_joint(joint, &link, parent, drive.effort());
    }
    text + "</robot>\n"
}

fn of_link(name: &str, link: &Link) -> String {
    format!(
        "  <link name=\"{name}\">\n    <inertial>\n      <origin xyz=\"{}\"/>\n      <mass value=\"{}\"/>\n      \
         {}\n    </inertial>\n  </link>\n",
        numbers(&link.centre),
        numbers([link.mass]),
        inertia(&link.tensor)
    )
}

fn of_joint(joint: &Joint, link: &Link, parent: &str, limit: Option<f64>) -> String {
    let (roll, pitch, yaw) = Rotation3::from_matrix_unchecked(link.pose.rotation).euler_angles();
    let mut text = format!(
        "  <joint name=\"{}\" type=\"{}\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{}\"/>\n    \
         <origin xyz=\"{}\" rpy=\"{}\"/>\n    <axis xyz=\"{}\"/>\n    <dynamics damping=\"{}\" friction=\"{}\"/>\n",
        joint.name,
        if joint.slides {
            "prismatic"
        } else {
            "continuous"
        },
        joint.body,
        numbers(&link.pose.origin),
        numbers([roll, pitch, yaw]),
        numbers(&link.axis),
        joint.drivetrain.damping,
        joint.drivetrain.friction,
    );
    let effort = limit.unwrap_or(NO_LIMIT);
    if joint.slides {
        let _ = writeln!(
            text,
            "    <limit lower=\"-{NO_LIMIT}\" upper=\"{NO_LIMIT}\" effort=\"{effort}\" velocity=\"{NO_LIMIT}\"/>"
        );
    } else if limit.is_some() {
        let _ = writeln!(
            text,
            "    <limit effort=\"{effort}\" velocity=\"{NO_LIMIT}\"/>"
        );
    }
    text + "  </joint>\n"
}
