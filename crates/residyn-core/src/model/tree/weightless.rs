use nalgebra::{Cholesky, DMatrix};

use super::body::{Joint, places};
use super::recursive::{Body, Links};
use crate::expr::{Graph, Node, Program};

/// The outermost joint that moves no inertia in some position, if any.
pub fn without_inertia(joints: &[Joint]) -> Option<&Joint> {
    let leads = |joint: &&Joint| joint.follows.is_none();
    let leaders: Vec<&Joint> = joints.iter().filter(leads).collect();
    let n = leaders.len();
    let program = mass_matrix(joints, &leaders);
    let positions = (0..4).map(|trial| {
        let angle = |j: usize| 0.3 + f64::from(trial) * (1.0 + 0.4 * j as f64);
        let q: Vec<f64> = (0..n).map(angle).collect();
        DMatrix::from_row_slice(n, n, &program.eval(&q))
    });
    let masses: Vec<DMatrix<f64>> = positions.collect();
    let is_regular = |first: usize| masses.iter().all(|mass| is_regular(mass, first));
    let light = (0..n).rev().find(|first| !is_regular(*first));
    light.map(|at| leaders[at])
}

/// The mass matrix of the joints that follow no other, row by row, as a function of their coordinates.
fn mass_matrix(joints: &[Joint], leaders: &[&Joint]) -> Program {
    let mut graph = Graph::new();
    let q: Vec<Node> = (1..=leaders.len())
        .map(|j| graph.input(&format!("q{j}")))
        .collect();
    let zero = graph.constant(0.0);
    let bodies: Vec<_> = joints
        .iter()
        .map(|joint| Body::of_parts(joint.inertia.parts().map(|part| graph.constant(part))))
        .collect();
    let mut mass = Links::at(&mut graph, &places(joints), &bodies, [zero; 3], &q).mass();
    for (k, joint) in leaders.iter().enumerate() {
        let rotor = graph.constant(joint.drivetrain.armature);
        mass[k][k] = graph.add(mass[k][k], rotor);
    }
    graph.finish(&mass.concat())
}

/// Whether the mass matrix of the joints from `first` on is positive definite, beyond rounding.
fn is_regular(mass: &DMatrix<f64>, first: usize) -> bool {
    let outer = mass.view_range(first.., first..).into_owned();
    let scale: f64 = outer.diagonal().iter().product();
    Cholesky::new(outer).is_some_and(|root| root.determinant() > 1e-12 * scale)
}
