//! The bodies of an arm, and the torques of its motion by Newton's and Euler's laws, body by body (Luh, Walker and Paul 1980).

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rand::{Rng, RngExt};

use residyn_core::model::Model;

/// One body, in the frame of its joint, whose z is the axis.
#[derive(Debug, Clone)]
struct Link {
    /// The frame in the previous body's frame, with the joint at zero.
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

/// An arm whose joints turn.
#[derive(Debug, Clone)]
pub(super) struct Bodies {
    links: Vec<Link>,
    /// m/s^2
    gravity: Vector3<f64>,
}

impl Bodies {
    /// The bodies that a model of a chain declares.
    pub fn of(model: &Model) -> Option<Self> {
        let values: Vec<f64> = model.parameters.iter().map(|p| p.value).collect();
        let mechanism = model.mechanism(&values)?;
        let link = |joint: &residyn_core::model::tree::Joint| {
            let (pose, of) = (joint.at_zero(), joint.inertia);
            let centre = of.moment / of.mass;
            Link {
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

    /// The same arm with each body's mass and size off by shares within this range, up or down.
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
        let axis = Vector3::z();
        let (mut spin, mut turning) = (Vector3::zeros(), Vector3::zeros());
        // A frame that falls with gravity feels no gravity.
        let mut moving = -self.gravity;
        let mut outward = Vec::new();
        for (k, link) in self.links.iter().enumerate() {
            let turned = Rotation3::from_axis_angle(&Unit::new_unchecked(axis), q[k]);
            let rotation = link.rotation * turned.matrix();
            let at_joint =
                moving + turning.cross(&link.origin) + spin.cross(&spin.cross(&link.origin));
            let back = rotation.transpose();
            let carried = back * spin;
            turning = back * turning + axis * qdd[k] + carried.cross(&(axis * qd[k]));
            spin = carried + axis * qd[k];
            moving = back * at_joint;
            let of_centre =
                moving + turning.cross(&link.centre) + spin.cross(&spin.cross(&link.centre));
            let force = of_centre * link.mass;
            let moment = link.inertia * turning + spin.cross(&(link.inertia * spin));
            outward.push((rotation, force, moment));
        }
        let mut torques = vec![0.0; self.links.len()];
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        let mut outer: Option<(Matrix3<f64>, Vector3<f64>)> = None;
        for (k, link) in self.links.iter().enumerate().rev() {
            let (rotation, own, own_moment) = outward[k];
            if let Some((rotation, origin)) = outer {
                let passed = rotation * force;
                moment = rotation * moment + origin.cross(&passed);
                force = passed;
            }
            force += own;
            moment += own_moment + link.centre.cross(&own);
            torques[k] = moment.z;
            outer = Some((rotation, link.origin));
        }
        torques
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use residyn_io::read_model;

    use super::Bodies;
    use residyn_core::model::Library;

    #[test]
    fn torques_are_those_of_the_declared_chain() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/bench/arm-seven.toml");
        let model = read_model(path, &Library::built_in()).unwrap();
        let (bodies, balance) = (Bodies::of(&model).unwrap(), model.torque_balance().unwrap());
        let n = model.joints;
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
            for (found, wanted) in found.iter().zip(balance.program.eval(&inputs)) {
                assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
            }
        }
    }
}
