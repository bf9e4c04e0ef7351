use nalgebra::Vector3;

use super::assemble::lower;
use super::chain::{Body, Inertia, Links, Place, Recovered};
use super::reader::Located;
use crate::data::Joint;
use crate::expr::{Formula, Graph, Node, Scope};

/// A serial chain of bodies, whose inertia is given by formulas in the parameters.
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

    fn joints(&self) -> usize {
        let numbers = self.places.iter().map(|place| place.joint.index() + 1);
        numbers.max().unwrap_or(0)
    }

    /// Gravity, then mass, first moments and tensor of each body.
    pub fn constants(&self, graph: &mut Graph, scope: &Scope) -> Vec<Node> {
        let formulas = self.formulas();
        formulas
            .map(|formula| lower(scope, graph, formula))
            .collect()
    }

    /// The chain with these numbers in place of [`Bodies::constants`].
    pub fn mechanism(&self, numbers: &[f64]) -> Recovered {
        let (gravity, parts) = numbers.split_at(self.gravity.len());
        let parts = parts.chunks_exact(parts.len() / self.bodies.len());
        let bodies: Vec<Inertia> = parts.map(Inertia::of_parts).collect();
        Recovered::of_chain(&self.places, &bodies, Vector3::from_column_slice(gravity))
    }

    /// The links at the angles that `scope` calls `q1..qn`.
    pub fn links<'g>(&self, graph: &'g mut Graph, scope: &Scope) -> Links<'g> {
        let gravity = std::array::from_fn(|a| lower(scope, graph, &self.gravity[a]));
        let body = |body: &Body<Located<Formula>>| body.map(|formula| lower(scope, graph, formula));
        let bodies: Vec<Body<Node>> = self.bodies.iter().map(body).collect();
        let q = self.named(scope, "q");
        Links::at(graph, &self.places, &bodies, gravity, &q)
    }
}
