//! A model as rigid-body simulators can represent it: a mechanism with the same equations, and those effects that their
//! joints and drives support.

use std::borrow::Borrow;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use super::powertrain::{Drive, Motor, Powertrains};
use crate::xml::escaped;
use crate::{ExportError, ExportModel, File};
use residyn_core::model::tree::{Drivetrain, Joint, Pose, recover, rounded};
use residyn_core::sim::{RK4, SEMI_IMPLICIT_EULER, Scheme};

/// A mechanism with its drives.
pub(crate) struct Mechanism {
    pub joints: Vec<Joint>,
    pub drives: Vec<Drive>,
    /// The motors that stand behind transmissions, one a joint at most.
    pub motors: Vec<Option<Motor>>,
    /// m/s^2, against z
    pub gravity: f64,
    /// The model's scheme as MuJoCo names it.
    pub integrator: &'static str,
    /// Parts of the model that it does not carry.
    pub not_carried: Vec<String>,
}

/// A body in the frame of its parent at q = 0.
pub(crate) struct Link {
    pub pose: Pose,
    pub axis: Vector3<f64>,
    pub mass: f64,
    pub centre: Vector3<f64>,
    /// About the centre of mass, in the body's axes.
    pub tensor: Matrix3<f64>,
}

const DRY_FRICTION: &str = "dry friction that reverses smoothly: MuJoCo's frictionloss lets joints stick, so the comparison uses the smooth form instead";

/// The schemes that MuJoCo has, and its names for them.
const INTEGRATORS: [(&Scheme, &str); 2] = [(SEMI_IMPLICIT_EULER, "Euler"), (RK4, "RK4")];

fn integrator(scheme: &Scheme) -> Result<&'static str, String> {
    let mut known = INTEGRATORS.into_iter();
    let found = known.find(|(known, _)| *known == scheme);
    found.map(|(_, name)| name).ok_or_else(|| {
        let known = INTEGRATORS.map(|(scheme, _)| scheme.name).join(" or ");
        format!("MuJoCo has no {}; export it with {known}", scheme.title)
    })
}

impl Mechanism {
    /// The mechanism of a model.
    ///
    /// # Errors
    /// Equations of an unknown mechanism, equations that depend on time, a network in their place, or a scheme that
    /// MuJoCo lacks.
    pub fn of(model: &ExportModel) -> Result<Self, String> {
        let Powertrains {
            joints: powertrains,
            mut not_carried,
        } = Powertrains::of(model)?;
        let mut found = match model.system.mechanism(&model.equations.values()) {
            Some(chain) => chain,
            None => recover(&model.declared(), &model.system.prismatic)
                .map_err(|reason| format!("{reason}; declare its bodies in [chain]"))?,
        };
        if found.joints.iter().any(|joint| joint.follows.is_some()) {
            return Err("one of its links follows the joint of another".into());
        }
        for (joint, name) in found.joints.iter_mut().zip(&model.system.joint_names) {
            joint.name = escaped(name);
        }
        for (joint, own) in found.joints.iter_mut().zip(&powertrains) {
            joint.reference += own.zero;
            joint.drivetrain = Drivetrain {
                damping: joint.drivetrain.damping + own.joint.damping,
                armature: joint.drivetrain.armature + own.joint.armature,
                ..own.joint
            };
        }
        if powertrains.iter().any(|own| own.joint.friction > 0.0) {
            not_carried.push(DRY_FRICTION.into());
        }
        Ok(Self {
            joints: found.joints,
            motors: powertrains.iter().map(|own| own.motor.clone()).collect(),
            drives: powertrains.into_iter().map(|own| own.drive).collect(),
            gravity: found.gravity,
            integrator: integrator(model.integrator.scheme())?,
            not_carried,
        })
    }

    /// Places of the joints that this joint carries, or the base.
    pub fn carried_by(&self, parent: Option<usize>) -> impl Iterator<Item = usize> {
        let joints = self.joints.iter().enumerate();
        let carried = joints.filter(move |(_, joint)| joint.parent == parent);
        carried.map(|(k, _)| k)
    }

    /// The bodies, in the order of their joints.
    pub fn links(&self) -> Vec<Link> {
        // The body's frame is put at the joint.
        let in_body = |joint: &Joint| Pose {
            origin: Vector3::zeros(),
            ..joint.in_body()
        };
        let link = |joint: &Joint| {
            let own = in_body(joint);
            let parent = joint.parent.map(|parent| in_body(&self.joints[parent]));
            let parent = parent.unwrap_or_else(Pose::identity);
            let pose = parent.then(&joint.at_zero()).then(&own.inverse());
            let inertia = joint.inertia.seen_from(&own);
            let (centre, tensor) = inertia.about_centre();
            Link {
                pose,
                axis: joint.axis,
                mass: inertia.mass,
                centre,
                tensor,
            }
        };
        self.joints.iter().map(link).collect()
    }
}

/// For each joint, the velocity (rad/s or m/s) over which dry friction reverses; 0 if it jumps.
pub(crate) fn friction_widths(model: &ExportModel) -> String {
    numbers(model.system.smoothing_velocities())
}

/// Numbers to 15 digits, separated by blanks; rounding errors about zero become zero.
pub(crate) fn numbers(numbers: impl IntoIterator<Item = impl Borrow<f64>>) -> String {
    let text = |number: &f64| match number.abs() < 1e-15 {
        true => "0".to_owned(),
        false => rounded(*number).to_string(),
    };
    let texts = numbers.into_iter().map(|number| text(number.borrow()));
    texts.collect::<Vec<_>>().join(" ")
}

/// Gravity, step and integrator of the model, for MuJoCo.
pub(crate) fn option(model: &ExportModel, mechanism: &Mechanism) -> String {
    format!(
        "<option gravity=\"{}\" timestep=\"{}\" integrator=\"{}\">\n    <flag eulerdamp=\"disable\"/>\n  </option>",
        numbers([0.0, 0.0, -mechanism.gravity]),
        mujoco_step_s(model),
        mechanism.integrator
    )
}

/// The step of the simulation, in s: commands are held over several.
pub(crate) fn mujoco_step_s(model: &ExportModel) -> f64 {
    model.step_s / model.integrator.substeps() as f64
}

/// XML declaration and provenance.
pub(crate) fn head(model: &ExportModel) -> String {
    // Two hyphens end a comment.
    let origin = model.provenance().to_string().replace("--", "- -");
    format!("<?xml version=\"1.0\"?>\n<!-- {origin} -->\n")
}

/// The one file of a format, whose contents `text` writes.
pub(crate) fn file(
    model: &ExportModel,
    path: &Path,
    format: &'static str,
    text: fn(&ExportModel, &Mechanism) -> String,
) -> Result<Vec<File>, ExportError> {
    let mechanism = Mechanism::of(model).map_err(|reason| model.refused(format, reason))?;
    let about = "a mechanism with the same equations";
    Ok(vec![File::new(path, text(model, &mechanism), about)])
}
