//! The bodies of a robot on a fixed base, and the torques of their motion by Newton's and Euler's laws, body by body (Luh,
//! Walker and Paul 1980).

use nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};
use rand::{Rng, RngExt};

use residyn_core::model::Model;

/// One body, in the frame of its joint, whose z is the axis.
#[derive(Debug, Clone)]
struct Link {
    /// The body that carries it, which comes before it; `None` for one on the base.
    parent: Option<usize>,
    /// The frame in that of the body that carries it, with the joint at zero.
    rotation: Matrix3<f64>,
    origin: Vector3<f64>,
    /// kg
    mass: f64,
    /// m
    centre: Vector3<f64>,
    /// About the centre, kg m^2.
    inertia: Matrix3<f64>,
}

/// The inertia tensor, kg m^2, of a point of this mass (kg) at a place (m).
fn of_point(mass: f64, at: Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * at.norm_squared() - at * at.transpose()) * mass
}

/// A tree of bodies whose joints turn.
#[derive(Debug, Clone)]
pub(super) struct Bodies {
    links: Vec<Link>,
    /// m/s^2
    gravity: Vector3<f64>,
}

impl Bodies {
    /// The bodies that a model of a chain or tree declares.
    pub fn of(model: &Model) -> Option<Self> {
        let values: Vec<f64> = model.parameters.iter().map(|p| p.value).collect();
        let mechanism = model.mechanism(&values)?;
        let link = |joint: &residyn_core::model::tree::Joint| {
            let (pose, of) = (joint.at_zero(), joint.inertia);
            let centre = of.moment / of.mass;
            Link {
                parent: joint.parent,
                rotation: pose.rotation,
                origin: pose.origin,
                mass: of.mass,
                centre,
                inertia: of.tensor - of_point(of.mass, centre),
            }
        };
        Some(Self {
            links: mechanism.joints.iter().map(link).collect(),
            gravity: -Vector3::z() * mechanism.gravity,
        })
    }

    /// Whether another body carries the one with this index.
    pub fn is_carried(&self, index: usize) -> bool {
        self.links[index].parent.is_some()
    }

    /// The same robot with each body's mass and size off by shares within this range, up or down.
    pub fn off_by(&self, [least, most]: [f64; 2], rng: &mut impl Rng) -> Self {
        let mut factor = || {
            let off = rng.random_range(least..=most);
            1.0 + if rng.random_bool(0.5) { off } else { -off }
        };
        let link = |link: &Link| {
            let (mass, size) = (factor(), factor());
            Link {
                mass: link.mass * mass,
                centre: link.centre * size,
                inertia: link.inertia * mass * size * size,
                ..link.clone()
            }
        };
        Self {
            links: self.links.iter().map(link).collect(),
            gravity: self.gravity,
        }
    }

    /// Mass of the last body, kg, and the distance of its centre of mass from its joint, m.
    pub fn tip(&self) -> (f64, f64) {
        let last = self.links.last();
        last.map_or((0.0, 0.0), |last| (last.mass, last.centre.norm()))
    }

    /// Put a point of this mass (kg) on the last body, in its frame (m).
    pub fn load(&mut self, mass: f64, at: Vector3<f64>) {
        let Some(last) = self.links.last_mut() else {
            return;
        };
        let whole = last.mass + mass;
        let centre = (last.centre * last.mass + at * mass) / whole;
        last.inertia += of_point(last.mass, last.centre - centre) + of_point(mass, at - centre);
        (last.mass, last.centre) = (whole, centre);
    }

    /// The torques, N m, for these angles, velocities and accelerations.
    pub fn torques(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
        self.at(q).torques(qd, qdd)
    }

    /// With the joints at these angles.
    pub fn at(&self, q: &[f64]) -> Posed<'_> {
        let turned = |(link, angle): (&Link, &f64)| {
            link.rotation * Rotation3::from_axis_angle(&Vector3::z_axis(), *angle)
        };
        Posed {
            bodies: self,
            rotations: self.links.iter().zip(q).map(turned).collect(),
        }
    }
}

/// The bodies at some angles.
pub(super) struct Posed<'b> {
    bodies: &'b Bodies,
    /// Of each body's frame in that of the body that carries it.
    rotations: Vec<Matrix3<f64>>,
}

/// How a body's frame moves, in its own axes.
#[derive(Clone, Copy)]
struct Moving {
    /// Angular velocity and its rate.
    spin: Vector3<f64>,
    turning: Vector3<f64>,
    /// Acceleration of the origin.
    origin: Vector3<f64>,
}

impl Posed<'_> {
    /// The torques, N m, for these velocities and accelerations.
    pub fn torques(&self, qd: &[f64], qdd: &[f64]) -> Vec<f64> {
        let links = &self.bodies.links;
        let moving = self.moving(qd, qdd);
        let mut acting: Vec<[Vector3<f64>; 2]> = links
            .iter()
            .zip(&moving)
            .map(|(link, own)| link.force_and_moment(own))
            .collect();
        let mut torques = vec![0.0; links.len()];
        for (k, link) in links.iter().enumerate().rev() {
            let [force, moment] = acting[k];
            torques[k] = moment.z;
            if let Some(parent) = link.parent {
                let passed = self.rotations[k] * force;
                acting[parent][0] += passed;
                acting[parent][1] += self.rotations[k] * moment + link.origin.cross(&passed);
            }
        }
        torques
    }

    fn moving(&self, qd: &[f64], qdd: &[f64]) -> Vec<Moving> {
        let axis = Vector3::z();
        // A frame that falls with gravity feels no gravity.
        let base = Moving {
            spin: Vector3::zeros(),
            turning: Vector3::zeros(),
            origin: -self.bodies.gravity,
        };
        let mut all: Vec<Moving> = Vec::with_capacity(qd.len());
        for (k, link) in self.bodies.links.iter().enumerate() {
            let carrier = link.parent.map_or(base, |parent| all[parent]);
            let Moving {
                spin,
                turning,
                origin,
            } = carrier;
            let at_joint =
                origin + turning.cross(&link.origin) + spin.cross(&spin.cross(&link.origin));
            let back = self.rotations[k].transpose();
            let carried = back * spin;
            all.push(Moving {
                spin: carried + axis * qd[k],
                turning: back * turning + axis * qdd[k] + carried.cross(&(axis * qd[k])),
                origin: back * at_joint,
            });
        }
        all
    }

    /// The mass matrix, kg m^2.
    pub fn mass(&self) -> DMatrix<f64> {
        let joints = self.rotations.len();
        let zero = vec![0.0; joints];
        let weight = self.torques(&zero, &zero);
        let mut mass = DMatrix::zeros(joints, joints);
        for j in 0..joints {
            let mut one = zero.clone();
            one[j] = 1.0;
            let needed = self.torques(&zero, &one);
            for (i, (needed, weight)) in needed.iter().zip(&weight).enumerate() {
                mass[(i, j)] = needed - weight;
            }
        }
        mass
    }
}

impl Link {
    /// The force, N, and the moment about the joint, N m, that move the body like this.
    fn force_and_moment(&self, own: &Moving) -> [Vector3<f64>; 2] {
        let Moving {
            spin,
            turning,
            origin,
        } = own;
        let of_centre =
            origin + turning.cross(&self.centre) + spin.cross(&spin.cross(&self.centre));
        let force = of_centre * self.mass;
        let moment = self.inertia * turning + spin.cross(&(self.inertia * spin));
        [force, moment + self.centre.cross(&force)]
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use residyn_io::read_model;

    use super::Bodies;
    use residyn_core::model::{Library, Model};

    fn declared(name: &str) -> Model {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/bench");
        read_model(folder.join(name), &Library::built_in()).unwrap()
    }

    #[test]
    fn torques_are_those_of_the_declared_chain_or_tree() {
        for name in ["arm-seven.toml", "robot-quadruped.toml", "robot-torso.toml"] {
            let model = declared(name);
            let (bodies, balance) = (Bodies::of(&model).unwrap(), model.torque_balance().unwrap());
            let n = model.joints;
            let own = |stem: &str, j: usize| {
                let name = format!("{stem}_{}", j + 1);
                let own = model.parameters.iter().find(|own| own.name == name);
                own.map_or(0.0, |own| own.value)
            };
            for k in 0..20 {
                let at = |of: usize| -> Vec<f64> {
                    (0..n)
                        .map(|j| ((3 * of + 7 * j + 5 * k) as f64).sin())
                        .collect()
                };
                let (q, qd, qdd) = (at(1), at(2), at(3));
                let found = bodies.torques(&q, &qd, &qdd);
                let zero = vec![0.0; n];
                let inputs = [&q, &qd, &zero, &vec![0.0], &qdd, &balance.values()]
                    .map(Vec::as_slice)
                    .concat();
                for (j, wanted) in balance.program.eval(&inputs).into_iter().enumerate() {
                    // A position loop whose target is zero gives a part of the torque.
                    let given = -own("kp", j) * q[j] - own("kd", j) * qd[j];
                    let found = found[j] - given;
                    assert!((found - wanted).abs() < 1e-9, "{name}: {found} {wanted}");
                }
            }
        }
    }

    #[test]
    fn legs_that_do_not_carry_each_other_share_no_inertia() {
        let bodies = Bodies::of(&declared("robot-quadruped.toml")).unwrap();
        let mass = bodies.at(&[0.3; 12]).mass();
        for i in 0..12 {
            for j in 0..12 {
                let coupled = mass[(i, j)].abs() > 1e-9;
                assert!(coupled <= (i / 3 == j / 3), "{i} {j}: {}", mass[(i, j)]);
            }
            assert!(mass[(i, i)] > 1e-3);
        }
    }
}
