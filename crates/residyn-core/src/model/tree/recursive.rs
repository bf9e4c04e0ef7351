//! Dynamics of a tree of links as operations of a [`Graph`]: recursive Newton-Euler for the torques of a motion,
//! the composite-rigid-body algorithm for the mass matrix (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters
//! 5 and 6).
//!
//! All vectors are in the axes of the link that they belong to, whose z is its joint's axis. Terms that the geometry
//! makes zero or one are folded while the operations are written.

use nalgebra::{Matrix3, Vector3};

use super::Pose;
use super::spatial::PARTS;
use crate::data::Joint;
use crate::expr::{Graph, Node, Unary};

/// A vector of values.
type Vector = [Node; 3];

/// Where a link sits on another one, and how it moves.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Index of the link that it sits on, which comes before it; `None` for the base.
    pub parent: Option<usize>,
    /// The link's frame in that of its parent (or the world) at coordinate zero; z is the axis.
    pub pose: Pose,
    /// Whether it slides along its axis rather than turning about it.
    pub slides: bool,
    /// Its coordinate is `ratio * q + offset` (rad or m), with this joint's q.
    pub joint: Joint,
    pub ratio: f64,
    pub offset: f64,
}

/// Inertia of a link, about the origin of its frame and along its axes: see
/// [`Inertia`](super::Inertia).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body<T> {
    /// kg
    pub mass: T,
    /// Mass times centre of mass, kg m.
    pub moment: [T; 3],
    /// xx, xy, xz, yy, yz, zz of the inertia tensor, kg m^2.
    pub tensor: [T; 6],
}

/// The links of a tree in some position.
pub struct Links<'g> {
    graph: &'g mut Graph,
    links: Vec<Link>,
    joints: usize,
    /// The acceleration equivalent to gravity, in the axes of the world.
    upwards: Vector,
}

struct Link {
    /// Index of the link that it sits on.
    parent: Option<usize>,
    slides: bool,
    joint: Joint,
    ratio: Node,
    /// Rotation from the parent's axes to the joint's frame at zero.
    fixed: Matrix3<f64>,
    /// Cosine and sine of a joint that turns.
    turn: Option<[Node; 2]>,
    /// Origin in the axes of the parent.
    origin: Vector,
    body: Body<Node>,
}

/// Velocity and acceleration of a link's frame.
#[derive(Clone, Copy)]
struct Motion {
    angular: Vector,
    angular_acceleration: Vector,
    /// Of the origin, gravity included.
    acceleration: Vector,
}

/// Force on a link, and moment about the origin of its frame.
#[derive(Clone, Copy)]
struct Wrench {
    force: Vector,
    moment: Vector,
}

impl<T> Body<T> {
    /// From mass, first moments, tensor.
    pub(super) fn of_parts([mass, x, y, z, xx, xy, xz, yy, yz, zz]: [T; PARTS]) -> Self {
        Self {
            mass,
            moment: [x, y, z],
            tensor: [xx, xy, xz, yy, yz, zz],
        }
    }

    /// Mass, first moments, tensor.
    pub fn parts(&self) -> impl Iterator<Item = &T> {
        std::iter::once(&self.mass)
            .chain(&self.moment)
            .chain(&self.tensor)
    }

    /// The same body with every part converted.
    pub fn map<U>(&self, mut convert: impl FnMut(&T) -> U) -> Body<U> {
        Body {
            mass: convert(&self.mass),
            moment: self.moment.each_ref().map(&mut convert),
            tensor: self.tensor.each_ref().map(&mut convert),
        }
    }
}

impl<'g> Links<'g> {
    /// The tree at angles (rad) or positions (m) `q` of its joints, with `gravity` (m/s^2) in the axes of the world.
    pub fn at(
        graph: &'g mut Graph,
        places: &[Place],
        bodies: &[Body<Node>],
        gravity: Vector,
        q: &[Node],
    ) -> Self {
        let upwards = gravity.map(|g| graph.neg(g));
        let links = places.iter().zip(bodies);
        let links = links.map(|(place, body)| Link::at(graph, place, *body, q[place.joint]));
        Self {
            links: links.collect(),
            joints: q.len(),
            graph,
            upwards,
        }
    }

    /// The torques (N m) or forces (N) that a motion needs.
    pub fn torques(&mut self, qd: &[Node], qdd: &[Node]) -> Vec<Node> {
        let zero = [self.graph.constant(0.0); 3];
        let still = Motion {
            angular: zero,
            angular_acceleration: zero,
            acceleration: self.upwards,
        };
        let mut motions: Vec<Motion> = Vec::with_capacity(self.links.len());
        for link in &self.links {
            let [qd, qdd] =
                [qd, qdd].map(|of_joints| self.graph.mul(link.ratio, of_joints[link.joint]));
            let parent = link.parent.map_or(&still, |parent| &motions[parent]);
            motions.push(link.carried(self.graph, parent, qd, qdd));
        }
        let needed = self.links.iter().zip(&motions);
        let needed = needed.map(|(link, motion)| link.needed(self.graph, motion));
        let mut wrenches: Vec<Wrench> = needed.collect();
        for (k, link) in self.links.iter().enumerate().rev() {
            if let Some(parent) = link.parent {
                let passed = link.passed_on(self.graph, &wrenches[k]);
                wrenches[parent] = wrenches[parent].plus(self.graph, &passed);
            }
        }
        let mut torques = vec![zero[0]; self.joints];
        for (link, wrench) in self.links.iter().zip(&wrenches) {
            let own = self.graph.mul(link.ratio, link.along_axis(wrench));
            torques[link.joint] = self.graph.add(torques[link.joint], own);
        }
        torques
    }

    /// The potential energy, J: zero at the world's origin.
    pub fn potential(&mut self) -> Node {
        // Height of each link's origin, and the acceleration against gravity in its axes.
        let ground = (self.graph.constant(0.0), self.upwards);
        let mut places: Vec<(Node, Vector)> = Vec::with_capacity(self.links.len());
        let mut sum = ground.0;
        for link in &self.links {
            let (height, upwards) = link.parent.map_or(&ground, |parent| &places[parent]);
            let step = self.graph.dot(upwards, &link.origin);
            let height = self.graph.add(*height, step);
            let upwards = link.inward(self.graph, upwards);
            let of_origin = self.graph.mul(link.body.mass, height);
            let of_centre = self.graph.dot(&upwards, &link.body.moment);
            let both = self.graph.add(of_origin, of_centre);
            sum = self.graph.add(sum, both);
            places.push((height, upwards));
        }
        sum
    }

    /// The mass matrix.
    pub fn mass(&mut self) -> Vec<Vec<Node>> {
        let mut composite: Vec<Body<Node>> = self.links.iter().map(|link| link.body).collect();
        let mut mass = vec![vec![self.graph.constant(0.0); self.joints]; self.joints];
        for (j, outer) in self.links.iter().enumerate().rev() {
            let mut wrench = outer.of_unit_acceleration(self.graph, &composite[j]);
            let mut at = Some(j);
            while let Some(i) = at {
                let inner = &self.links[i];
                let scale = self.graph.mul(inner.ratio, outer.ratio);
                let entry = self.graph.mul(scale, inner.along_axis(&wrench));
                let mut add = |row: Joint, column: Joint| {
                    mass[row][column] = self.graph.add(mass[row][column], entry);
                };
                add(inner.joint, outer.joint);
                if i < j {
                    add(outer.joint, inner.joint);
                }
                if inner.parent.is_some() {
                    wrench = inner.passed_on(self.graph, &wrench);
                }
                at = inner.parent;
            }
            if let Some(parent) = outer.parent {
                let seen = outer.seen_from_parent(self.graph, &composite[j]);
                composite[parent] = sum(self.graph, &composite[parent], &seen);
            }
        }
        mass
    }
}

impl Link {
    /// The link at joint coordinate `q`.
    fn at(graph: &mut Graph, place: &Place, body: Body<Node>, q: Node) -> Self {
        let (ratio, offset) = (graph.constant(place.ratio), graph.constant(place.offset));
        let q = graph.mul(ratio, q);
        let q = graph.add(q, offset);
        let mut origin = constant(graph, &place.pose.origin);
        let mut turn = None;
        if place.slides {
            let axis = constant(graph, &place.pose.rotation.column(2).into());
            let along = scaled(graph, q, &axis);
            origin = add(graph, &origin, &along);
        } else {
            turn = Some([graph.unary(Unary::Cos, q), graph.unary(Unary::Sin, q)]);
        }
        Self {
            parent: place.parent,
            slides: place.slides,
            joint: place.joint,
            ratio,
            fixed: place.pose.rotation,
            turn,
            origin,
            body,
        }
    }

    /// A vector of the parent in this link's axes.
    fn inward(&self, graph: &mut Graph, vector: &Vector) -> Vector {
        let [x, y, z] = turned(graph, &self.fixed.transpose(), vector);
        let Some([c, s]) = self.turn else {
            return [x, y, z];
        };
        let (cx, sy) = (graph.mul(c, x), graph.mul(s, y));
        let (cy, sx) = (graph.mul(c, y), graph.mul(s, x));
        [graph.add(cx, sy), graph.sub(cy, sx), z]
    }

    /// A vector of this link in the axes of the parent.
    fn outward(&self, graph: &mut Graph, [x, y, z]: &Vector) -> Vector {
        let mut at_zero = [*x, *y, *z];
        if let Some([c, s]) = self.turn {
            let (cx, sy) = (graph.mul(c, *x), graph.mul(s, *y));
            let (cy, sx) = (graph.mul(c, *y), graph.mul(s, *x));
            at_zero = [graph.sub(cx, sy), graph.add(cy, sx), *z];
        }
        turned(graph, &self.fixed, &at_zero)
    }

    /// The motion of this link's frame, from that of the parent's.
    fn carried(&self, graph: &mut Graph, parent: &Motion, qd: Node, qdd: Node) -> Motion {
        let lever = cross(graph, &parent.angular_acceleration, &self.origin);
        let swept = cross(graph, &parent.angular, &self.origin);
        let inwards = cross(graph, &parent.angular, &swept);
        let at_origin = add(graph, &parent.acceleration, &lever);
        let at_origin = add(graph, &at_origin, &inwards);
        let [mut angular, mut angular_acceleration, mut acceleration] =
            [parent.angular, parent.angular_acceleration, at_origin]
                .map(|vector| self.inward(graph, &vector));
        // w x z qd
        let (xd, yd) = (graph.mul(angular[1], qd), graph.mul(angular[0], qd));
        if self.slides {
            // The Coriolis term counts twice.
            let (xd, yd) = (graph.add(xd, xd), graph.add(yd, yd));
            acceleration[0] = graph.add(acceleration[0], xd);
            acceleration[1] = graph.sub(acceleration[1], yd);
            acceleration[2] = graph.add(acceleration[2], qdd);
        } else {
            angular_acceleration[0] = graph.add(angular_acceleration[0], xd);
            angular_acceleration[1] = graph.sub(angular_acceleration[1], yd);
            angular_acceleration[2] = graph.add(angular_acceleration[2], qdd);
            angular[2] = graph.add(angular[2], qd);
        }
        Motion {
            angular,
            angular_acceleration,
            acceleration,
        }
    }

    /// The wrench that gives this link's body its motion: Newton and Euler.
    fn needed(&self, graph: &mut Graph, motion: &Motion) -> Wrench {
        let Body { mass, moment, .. } = &self.body;
        let spin = times(graph, &self.body, &motion.angular);
        let gyroscopic = cross(graph, &motion.angular, &spin);
        let spin_up = times(graph, &self.body, &motion.angular_acceleration);
        let carried = cross(graph, moment, &motion.acceleration);
        let moment_needed = add(graph, &spin_up, &gyroscopic);
        let swept = cross(graph, &motion.angular, moment);
        let inwards = cross(graph, &motion.angular, &swept);
        let lever = cross(graph, &motion.angular_acceleration, moment);
        let of_mass = scaled(graph, *mass, &motion.acceleration);
        let force = add(graph, &of_mass, &lever);
        Wrench {
            force: add(graph, &force, &inwards),
            moment: add(graph, &moment_needed, &carried),
        }
    }

    /// The wrench that moves a body when this joint alone has unit acceleration.
    fn of_unit_acceleration(&self, graph: &mut Graph, body: &Body<Node>) -> Wrench {
        let zero = graph.constant(0.0);
        let [x, y, _] = body.moment;
        if self.slides {
            Wrench {
                force: [zero, zero, body.mass],
                moment: [y, graph.neg(x), zero],
            }
        } else {
            let [_, _, xz, _, yz, zz] = body.tensor;
            Wrench {
                force: [graph.neg(y), x, zero],
                moment: [xz, yz, zz],
            }
        }
    }

    /// A wrench on this link as one on its parent, about the parent's origin.
    fn passed_on(&self, graph: &mut Graph, wrench: &Wrench) -> Wrench {
        let force = self.outward(graph, &wrench.force);
        let moment = self.outward(graph, &wrench.moment);
        let lever = cross(graph, &self.origin, &force);
        Wrench {
            force,
            moment: add(graph, &moment, &lever),
        }
    }

    /// The share of a wrench that the drive carries.
    fn along_axis(&self, wrench: &Wrench) -> Node {
        if self.slides {
            wrench.force[2]
        } else {
            wrench.moment[2]
        }
    }

    /// A body that moves with this link, about the origin and along the axes of the parent.
    fn seen_from_parent(&self, graph: &mut Graph, body: &Body<Node>) -> Body<Node> {
        let moment = self.outward(graph, &body.moment);
        let p = self.origin;
        let shift = scaled(graph, body.mass, &p);
        // With c = m p + 2 R mc: I + p.c 1 - (p c^T + c p^T) / 2 moves the tensor from here to there.
        let twice = add(graph, &moment, &moment);
        let c = add(graph, &shift, &twice);
        let moved = spread(graph, &p, &c);
        let turned = self.turned_tensor(graph, &body.tensor);
        Body {
            mass: body.mass,
            moment: add(graph, &moment, &shift),
            tensor: std::array::from_fn(|k| graph.add(turned[k], moved[k])),
        }
    }

    /// R I R^T of a symmetric tensor.
    fn turned_tensor(&self, graph: &mut Graph, tensor: &[Node; 6]) -> [Node; 6] {
        let [xx, xy, xz, yy, yz, zz] = *tensor;
        let columns = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        // Rows of R I are those of (R I)^T = I R^T.
        let half = columns.map(|column| self.outward(graph, &column));
        let rows: [Vector; 3] = std::array::from_fn(|a| half.map(|column| column[a]));
        let full = rows.map(|row| self.outward(graph, &row));
        [
            full[0][0], full[0][1], full[0][2], full[1][1], full[1][2], full[2][2],
        ]
    }
}

impl Wrench {
    fn plus(&self, graph: &mut Graph, other: &Self) -> Self {
        Self {
            force: add(graph, &self.force, &other.force),
            moment: add(graph, &self.moment, &other.moment),
        }
    }
}

fn sum(graph: &mut Graph, a: &Body<Node>, b: &Body<Node>) -> Body<Node> {
    Body {
        mass: graph.add(a.mass, b.mass),
        moment: add(graph, &a.moment, &b.moment),
        tensor: std::array::from_fn(|k| graph.add(a.tensor[k], b.tensor[k])),
    }
}

/// The tensor times a vector.
fn times(graph: &mut Graph, body: &Body<Node>, vector: &Vector) -> Vector {
    let [xx, xy, xz, yy, yz, zz] = body.tensor;
    [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]].map(|row| graph.dot(&row, vector))
}

/// p.c 1 - (p c^T + c p^T) / 2
fn spread(graph: &mut Graph, p: &Vector, c: &Vector) -> [Node; 6] {
    let half = graph.constant(0.5);
    let [x, y, z]: Vector = std::array::from_fn(|a| graph.mul(p[a], c[a]));
    let mut mixed = |a: usize, b: usize| {
        let (ab, ba) = (graph.mul(p[a], c[b]), graph.mul(p[b], c[a]));
        let both = graph.add(ab, ba);
        let half = graph.mul(half, both);
        graph.neg(half)
    };
    let (xy, xz, yz) = (mixed(0, 1), mixed(0, 2), mixed(1, 2));
    [
        graph.add(y, z),
        xy,
        xz,
        graph.add(x, z),
        yz,
        graph.add(x, y),
    ]
}

fn constant(graph: &mut Graph, vector: &Vector3<f64>) -> Vector {
    std::array::from_fn(|a| graph.constant(vector[a]))
}

fn add(graph: &mut Graph, a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|k| graph.add(a[k], b[k]))
}

fn scaled(graph: &mut Graph, by: Node, vector: &Vector) -> Vector {
    vector.map(|part| graph.mul(by, part))
}

fn cross(graph: &mut Graph, a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let (left, right) = (graph.mul(a[i], b[j]), graph.mul(a[j], b[i]));
        graph.sub(left, right)
    })
}

fn turned(graph: &mut Graph, by: &Matrix3<f64>, vector: &Vector) -> Vector {
    std::array::from_fn(|a| {
        let row: Vector3<f64> = by.row(a).transpose();
        let row = constant(graph, &row);
        graph.dot(&row, vector)
    })
}
