//! How far the spheres around a rig's links keep off each other and off boxes.

use nalgebra::Vector3;

use residyn_core::model::Model;
use residyn_core::model::tree::{Pose, Recovered};

use crate::limits::{Cuboid, Limits, Sphere};

/// The links of a rig with their spheres, and the boxes around it.
#[derive(Debug, Clone)]
pub struct Clearance {
    mechanism: Option<Recovered>,
    spheres: Vec<Sphere>,
    boxes: Vec<Cuboid>,
    /// Spheres that must not touch: those of links that are not joined.
    pairs: Vec<(usize, usize)>,
}

impl Clearance {
    /// That of a model's links, if the limits give spheres.
    pub fn of(model: &Model, limits: &Limits) -> Self {
        let spheres = limits.spheres.clone();
        let mechanism = (!spheres.is_empty())
            .then(|| model.mechanism(&model.values()))
            .flatten();
        let mut clearance = Self {
            mechanism,
            spheres,
            boxes: limits.boxes.clone(),
            pairs: Vec::new(),
        };
        let all = 0..clearance.spheres.len();
        let pairs = all.clone().flat_map(|a| (0..a).map(move |b| (b, a)));
        clearance.pairs = pairs
            .filter(|(a, b)| !clearance.are_joined(*a, *b))
            .collect();
        clearance
    }

    /// Whether there is anything to keep off.
    pub fn is_needed(&self) -> bool {
        self.mechanism.is_some() && !(self.pairs.is_empty() && self.boxes.is_empty())
    }

    /// Whether two spheres are of one link or of neighbours, or one is of the base and the other of a link on it.
    fn are_joined(&self, a: usize, b: usize) -> bool {
        let link = |sphere: usize| {
            self.spheres[sphere]
                .joint
                .map(residyn_core::data::Joint::index)
        };
        let parent = |link: Option<usize>| {
            let mechanism = self.mechanism.as_ref();
            link.and_then(|link| mechanism?.joints[link].parent)
        };
        let (a, b) = (link(a), link(b));
        a == b || (a.is_some() && parent(a) == b) || (b.is_some() && parent(b) == a)
    }

    /// The distances (m) between surfaces at these angles, below zero where they overlap: pairs of spheres, then each
    /// sphere from each box.
    pub fn distances(&self, q: &[f64]) -> Vec<f64> {
        let Some(mechanism) = &self.mechanism else {
            return Vec::new();
        };
        let frames = frames(mechanism, q);
        let centre = |sphere: &Sphere| match sphere.joint {
            Some(joint) => {
                let frame = &frames[joint.index()];
                frame.rotation * sphere.centre + frame.origin
            }
            None => sphere.centre,
        };
        let centres: Vec<Vector3<f64>> = self.spheres.iter().map(centre).collect();
        let between = self.pairs.iter().map(|(a, b)| {
            (centres[*a] - centres[*b]).norm() - self.spheres[*a].radius - self.spheres[*b].radius
        });
        let moving = self
            .spheres
            .iter()
            .zip(&centres)
            .filter(|(sphere, _)| sphere.joint.is_some());
        let from_boxes = moving.flat_map(|(sphere, centre)| {
            self.boxes
                .iter()
                .map(move |cuboid| outside(cuboid, centre) - sphere.radius)
        });
        between.chain(from_boxes).collect()
    }
}

/// The frame of each link in that of the base.
fn frames(mechanism: &Recovered, q: &[f64]) -> Vec<Pose> {
    let mut frames: Vec<Pose> = Vec::with_capacity(mechanism.joints.len());
    let mut leaders = 0..;
    let number: Vec<usize> = (mechanism.joints.iter())
        .map(|joint| match joint.follows {
            Some(follows) => follows.leader,
            None => leaders.next().unwrap_or(0),
        })
        .collect();
    for (k, joint) in mechanism.joints.iter().enumerate() {
        let coordinate = match joint.follows {
            Some(follows) => follows.ratio * q[number[follows.leader]] + follows.offset,
            None => q[number[k]],
        };
        let own = joint.at(coordinate);
        frames.push(joint.parent.map_or(own, |parent| frames[parent].then(&own)));
    }
    frames
}

/// The distance of a point from a box, below zero inside.
fn outside(cuboid: &Cuboid, point: &Vector3<f64>) -> f64 {
    let beyond = (cuboid.least - point).sup(&(point - cuboid.greatest));
    match beyond.max() > 0.0 {
        true => beyond.map(|part| part.max(0.0)).norm(),
        false => beyond.max(),
    }
}
