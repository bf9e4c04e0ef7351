use nalgebra::Vector3;

use super::assemble::lower;
use super::reader::Located;
use super::tree::{Body, Inertia, Links, Place, Recovered};
use crate::data::Joint;
use crate::expr::{Formula, Graph, Node, Scope};

/// A tree of bodies, whose inertia is given by formulas in the parameters.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bodies {
    /// Acceleration, m/s^2, in the axes of the world.
    pub gravity: [Located<Formula>; 3],
    pub places: Vec<Place>,
    pub bodies: Vec<Body<Located<Formula>>>,
}

impl Bodies {
    pub fn formulas(&self) -> impl Iterator<Item = &Located<Formula>> {
        let of_bodies = self.bodies.iter().flat_map(Body::parts);
        self.gravity.iter().chain(of_bodies)
    }

    /// The last joint that moves a body with a formula for which `holds`, or else the last joint if gravity has one.
    pub fn outermost(&self, holds: impl Fn(&Located<Formula>) -> bool) -> Option<Joint> {
        let of_body = self
            .bodies
            .iter()
            .rposition(|body| body.parts().any(&holds));
        let has_gravity = || self.gravity.iter().any(&holds);
        let of_gravity = || has_gravity().then(|| self.bodies.len() - 1);
        Some(self.places[of_body.or_else(of_gravity)?].joint)
    }

    /// Total energy (J) and the power of the torques (W).
    pub fn energy(&self, graph: &mut Graph, scope: &Scope) -> (Node, Node) {
        let [qd, tau] = ["qd", "tau"].map(|stem| self.named(scope, stem));
        let mut links = self.links(graph, scope);
        let (mass, potential) = (links.mass(), links.potential());
        let momentum = mass.iter().map(|row| graph.dot(row, &qd));
        let momentum: Vec<Node> = momentum.collect();
        let twice = graph.dot(&momentum, &qd);
        let half = graph.constant(0.5);
        let kinetic = graph.mul(half, twice);
        (graph.add(kinetic, potential), graph.dot(&tau, &qd))
    }

    /// `q1..qn` for the stem `q`.
    fn named(&self, scope: &Scope, stem: &str) -> Vec<Node> {
        let names = Joint::all(self.joints()).map(|joint| joint.name(stem));
        names.filter_map(|name| scope.get(&name)).collect()
    }

    /// Whether a joint carries a link that another one moves.
    pub fn carries(&self, joint: Joint, other: Joint) -> bool {
        let mover = |link: usize| self.places[link].joint;
        let mut others = self.places.iter().filter(|place| place.joint == other);
        others.any(|place| place.parent.is_some_and(|parent| mover(parent) == joint))
    }

    /// Whether a joint moves a link on the base.
    pub fn is_on_base(&self, joint: Joint) -> bool {
        let mut own = self.places.iter().filter(|place| place.joint == joint);
        own.any(|place| place.parent.is_none())
    }

    /// Whether a joint moves the last link of a limb.
    pub fn is_tip(&self, joint: Joint) -> bool {
        let mut others = Joint::all(self.joints()).filter(|other| *other != joint);
        !others.any(|other| self.carries(joint, other))
    }

    fn joints(&self) -> usize {
        let numbers = self.places.iter().map(|place| place.joint.index() + 1);
        numbers.max().unwrap_or(0)
    }

    /// Gravity, then mass, first moments and tensor of each body.
    pub fn constants(&self, graph: &mut Graph, scope: &Scope) -> Vec<Node> {
        let formulas = self.formulas();
        formulas
            .map(|formula| lower(scope, graph, &formula.value))
            .collect()
    }

    /// The tree with these numbers in place of [`Bodies::constants`].
    pub fn mechanism(&self, numbers: &[f64]) -> Recovered {
        let (gravity, parts) = numbers.split_at(self.gravity.len());
        let parts = parts.chunks_exact(parts.len() / self.bodies.len());
        let bodies: Vec<Inertia> = parts.map(Inertia::of_parts).collect();
        Recovered::of_tree(&self.places, &bodies, Vector3::from_column_slice(gravity))
    }

    /// The links at the angles that `scope` calls `q1..qn`.
    pub fn links<'g>(&self, graph: &'g mut Graph, scope: &Scope) -> Links<'g> {
        self.loaded(graph, scope, &[])
    }

    /// As above, with point masses on the bodies that these joints move: mass (kg) and position in the body's frame (m).
    pub fn loaded<'g>(
        &self,
        graph: &'g mut Graph,
        scope: &Scope,
        payloads: &[(Joint, [Node; 4])],
    ) -> Links<'g> {
        let gravity = std::array::from_fn(|a| lower(scope, graph, &self.gravity[a].value));
        let body =
            |body: &Body<Located<Formula>>| body.map(|formula| lower(scope, graph, &formula.value));
        let mut bodies: Vec<Body<Node>> = self.bodies.iter().map(body).collect();
        for (joint, payload) in payloads {
            let link = self.places.iter().rposition(|place| place.joint == *joint);
            let link = link.expect("each joint moves a link");
            bodies[link] = with_point(graph, &bodies[link], *payload);
        }
        let q = self.named(scope, "q");
        Links::at(graph, &self.places, &bodies, gravity, &q)
    }
}

/// A body with a point mass added.
fn with_point(graph: &mut Graph, body: &Body<Node>, [mass, x, y, z]: [Node; 4]) -> Body<Node> {
    let place = [x, y, z];
    let moment = place.map(|along| graph.mul(mass, along));
    // Mass times the products of the coordinates.
    let spread: [[Node; 3]; 3] = moment.map(|moment| place.map(|along| graph.mul(moment, along)));
    let mut sum = |a: Node, b: Node| graph.add(a, b);
    let [xx, yy, zz] = [[1, 2], [0, 2], [0, 1]].map(|[a, b]| sum(spread[a][a], spread[b][b]));
    let [of_xx, of_xy, of_xz, of_yy, of_yz, of_zz] = body.tensor;
    Body {
        mass: sum(body.mass, mass),
        moment: std::array::from_fn(|k| sum(body.moment[k], moment[k])),
        tensor: [
            sum(of_xx, xx),
            graph.sub(of_xy, spread[0][1]),
            graph.sub(of_xz, spread[0][2]),
            graph.add(of_yy, yy),
            graph.sub(of_yz, spread[1][2]),
            graph.add(of_zz, zz),
        ],
    }
}
