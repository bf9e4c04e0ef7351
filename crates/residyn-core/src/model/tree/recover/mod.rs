//! Recovers a mechanism from equations of motion, for a few kinds: one joint, two revolute joints in one plane, a
//! revolute joint on a prismatic one. Masses and lengths are chosen to give the same motion, which does not determine
//! all of them.

mod links;
mod shape;

use std::f64::consts::PI;

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::spatial::turn;
use super::{Drivetrain, Follows, Inertia, Joint, Place, Pose};
use crate::model::Dynamics;
use links::{Build, Planar};
use shape::{KNOWN, ROUNDING, Shape, beyond_rounding};

/// A mechanism with the same equations of motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Recovered {
    pub joints: Vec<Joint>,
    /// m/s^2
    pub gravity: f64,
}

impl Recovered {
    /// A tree as it is, turned so that gravity (m/s^2, in the axes of the world) acts against z.
    pub fn of_tree(places: &[Place], bodies: &[Inertia], gravity: Vector3<f64>) -> Self {
        let links = places.iter().zip(bodies).enumerate();
        let mut joints: Vec<Joint> = links
            .map(|(k, (place, inertia))| Joint {
                name: format!("joint{}", k + 1),
                body: format!("link{}", k + 1),
                parent: place.parent,
                slides: place.slides,
                pose: place.pose,
                reference: 0.0,
                across: Vector3::x(),
                axis: Vector3::z(),
                anchor: Vector3::zeros(),
                inertia: *inertia,
                follows: follows(places, k),
                drivetrain: Drivetrain::default(),
            })
            .collect();
        let level = Pose {
            rotation: downwards(gravity),
            origin: Vector3::zeros(),
        };
        let on_base = joints.iter_mut().filter(|joint| joint.parent.is_none());
        on_base.for_each(|joint| joint.pose = level.then(&joint.pose));
        Self {
            joints,
            gravity: gravity.norm(),
        }
    }
}

/// The rotation that turns a direction against z.
fn downwards(direction: Vector3<f64>) -> Matrix3<f64> {
    let turned = Rotation3::rotation_between(&direction, &-Vector3::z());
    // There is no unique axis of rotation if the direction is z itself.
    turned.map_or_else(|| turn(Vector3::x(), PI), Rotation3::into_inner)
}

/// How a link follows the first link of its joint.
fn follows(places: &[Place], link: usize) -> Option<Follows> {
    let Place {
        joint,
        ratio,
        offset,
        ..
    } = places[link];
    let leader = places.iter().position(|place| place.joint == joint)?;
    (leader != link).then_some(Follows {
        leader,
        ratio,
        offset,
    })
}

/// Gravity if the equations do not contain it, m/s^2.
const GRAVITY: f64 = 9.81;

/// The mechanism with the equations of `declared`, effects excluded; `prismatic` says which joints slide.
///
/// In the world frame at q = 0, joints turn about y or slide along a horizontal or inclined x, and gravity acts against
/// z.
///
/// # Errors
/// Equations of another kind of mechanism, or with inertia that no bodies can have.
pub fn recover(declared: &Dynamics, prismatic: &[bool]) -> Result<Recovered, String> {
    let (shape, build): (Shape, Build) = match prismatic {
        [false] => (Shape::turning(), links::turning),
        [true] => (Shape::sliding(), links::sliding),
        [false, false] => (Shape::arm(), links::arm),
        [true, false] => (Shape::on_a_slide(), links::on_a_slide),
        _ => return Err(KNOWN.to_owned()),
    };
    let found = shape.fit(declared)?;
    let gravity = gravity(declared);
    let (mut joints, downward) = build(&found, gravity)?;
    let largest = found.iter().map(|x| x.abs()).fold(0.0, f64::max);
    for (joint, damping) in joints.iter_mut().zip(shape.damping(&found)) {
        if *damping < -ROUNDING * largest {
            return Err(format!("{} is driven by its own speed", joint.name));
        }
        joint.drivetrain.damping = beyond_rounding(*damping, largest);
    }
    Ok(upright(joints, downward, gravity))
}

/// The model's own gravity if it has one, m/s^2.
fn gravity(declared: &Dynamics) -> f64 {
    let mut parameters = declared.parameters.iter();
    let own = parameters.find(|p| p.unit == "m/s^2" && p.value > 0.0);
    own.map_or(GRAVITY, |p| p.value)
}

/// Joints given in the world frame as joints of a tree, turned so that gravity acts against z. Gravity that differs
/// from the model's by rounding is set to the model's.
fn upright(mut joints: Vec<Joint>, downward: Planar, own: f64) -> Recovered {
    let level = Pose {
        rotation: turn(Vector3::y(), (-downward.conj()).arg()),
        origin: Vector3::zeros(),
    };
    let mut inner = level.inverse();
    for joint in &mut joints {
        let outer = joint.pose;
        joint.pose = inner.inverse().then(&outer);
        inner = outer;
    }
    let found = downward.norm();
    let is_own = (found - own).abs() <= ROUNDING * own;
    Recovered {
        joints,
        gravity: if is_own { own } else { found },
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::recover;
    use crate::model::{Library, Model};

    fn recovered(system: &Model) -> Result<super::Recovered, String> {
        let declared = system.with_effects(Vec::new()).dynamics();
        recover(&declared, &system.prismatic)
    }

    fn built_in(name: &str) -> super::Recovered {
        recovered(&Library::built_in().model(name).unwrap()).unwrap()
    }

    #[test]
    fn the_acrobots_elbow_is_one_link_from_its_shoulder() {
        let acrobot = built_in("acrobot");
        let elbow = acrobot.joints[1].pose.origin;
        assert!((elbow.norm() - 1.0).abs() < 1e-12, "{elbow}");
        assert!((acrobot.gravity - 9.8).abs() < 1e-12);
        let moment = acrobot.joints[1].inertia.moment;
        assert!((moment.norm() - 0.5).abs() < 1e-12, "{moment}");
    }

    #[test]
    fn the_cartpoles_gravity_is_that_of_its_file() {
        let cartpole = built_in("cartpole");
        assert_eq!(cartpole.gravity, 9.81);
        let whole: f64 = cartpole.joints.iter().map(|joint| joint.inertia.mass).sum();
        assert!((whole - 1.1).abs() < 1e-12);
    }

    #[test]
    fn equations_of_no_mechanism_are_refused() {
        for (bias, said) in [
            ("q1^3", "not one of the known mechanisms"),
            ("sin(2*q1)", "not one of the known mechanisms"),
            ("tanh(qd1)", "not one of the known mechanisms"),
            ("-qd1", "driven by its own speed"),
        ] {
            let text = format!(
                "[system]\nname = \"odd\"\njoints = 1\n[dynamics]\nmass = [[\"1\"]]\nbias = [\"{bias}\"]\n"
            );
            let odd = Model::from_text(Path::new("odd.toml"), &text, &[]).unwrap();
            let error = recovered(&odd).unwrap_err();
            assert!(error.contains(said), "{bias}: {error}");
        }
    }
}
