//! The limbs of a model: groups of joints none of which moves those of another, such as the legs of a robot whose base is
//! fixed.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::bodies::Bodies;
use super::drive::Drive;
use super::fitted::FittedEffect;
use super::reader::Located;
use super::system::{Equations, Model, Motion};
use super::tree::Place;
use crate::data::{Joint, of_joints};
use crate::expr::Formula;

impl Model {
    /// The joints of each limb, in their order. A model that is not made of bodies has one limb, as does one in which a
    /// free parameter enters the equations of several.
    pub fn limbs(&self) -> Vec<Vec<Joint>> {
        let all: Vec<Joint> = Joint::all(self.joints).collect();
        let Motion::Tree(bodies) = &self.equations.motion else {
            return vec![all];
        };
        let mut limbs = Groups::of(self.joints);
        for place in &bodies.places {
            if let Some(parent) = place.parent {
                limbs.join(place.joint, bodies.places[parent].joint);
            }
        }
        for effect in self
            .effects
            .iter()
            .filter(|effect| effect.effect.is_coupling())
        {
            limbs.join(effect.joint, effect.joint.next());
        }
        let limbs = limbs.listed();
        let names: Vec<BTreeSet<usize>> = limbs.iter().map(|limb| self.free_in(limb)).collect();
        let shared = |(k, own): (usize, &BTreeSet<usize>)| {
            let mut others = names[..k].iter();
            others.any(|other| !own.is_disjoint(other))
        };
        match names.iter().enumerate().any(shared) {
            true => vec![all],
            false => limbs,
        }
    }

    /// A limb as a model of its own, with its joints numbered from 1. Its parameters are those of the whole; those that
    /// it does not mention are fixed.
    ///
    /// # Panics
    /// If these joints are not those of one of the [limbs](Model::limbs).
    #[must_use]
    pub fn limb(&self, joints: &[Joint]) -> Self {
        let Motion::Tree(bodies) = &self.equations.motion else {
            assert_eq!(joints.len(), self.joints, "there is one limb");
            return self.clone();
        };
        let place_of = |joint: Joint| joints.iter().position(|own| *own == joint);
        let free = self.free_in(joints);
        let mut limb = Self {
            joints: joints.len(),
            joint_names: of_joints(&self.joint_names, joints),
            like: (self.like.as_ref()).map(|groups| like_of_limb(groups, joints)),
            prismatic: of_joints(&self.prismatic, joints),
            smoothing_velocity: (self.smoothing_velocity.as_ref())
                .map(|widths| of_joints(widths, joints)),
            sides: (self.sides.as_ref()).map(|sides| of_joints(sides, joints)),
            columns: self.columns.of_joints(joints),
            equations: Arc::new(Equations {
                motion: Motion::Tree(Box::new(bodies.limb(joints))),
                drive: (self.equations.drive.as_ref()).map(|drive| drive.limb(joints)),
                ..(*self.equations).clone()
            }),
            ..self.clone()
        };
        for (k, parameter) in limb.parameters.iter_mut().enumerate() {
            parameter.fixed |= !free.contains(&k);
        }
        limb.effects = (self.effects.iter())
            .filter_map(|effect| Some(effect.on(Joint::at(place_of(effect.joint)?))))
            .collect();
        limb
    }

    /// Indices of the free parameters that the equations of these joints mention.
    fn free_in(&self, joints: &[Joint]) -> BTreeSet<usize> {
        let of_bodies: Vec<&Located<Formula>> = match &self.equations.motion {
            Motion::Tree(bodies) => bodies.formulas_of(joints).collect(),
            other => other.formulas().collect(),
        };
        let drives = self.equations.drive.iter().map(Drive::formulas);
        let of_drives = drives.flat_map(|drives| joints.iter().map(|joint| &drives[*joint]));
        let mut formulas: Vec<&Formula> = of_bodies.iter().map(|formula| &formula.value).collect();
        formulas.extend(of_drives.map(|formula| &formula.value));
        let mut names: BTreeSet<&str> = formulas.iter().flat_map(|f| f.names()).collect();
        // Intermediates may mention those before them.
        for (name, formula) in self.equations.lets.iter().rev() {
            if names.contains(name.as_str()) {
                names.extend(formula.value.names());
            }
        }
        let parameters = self.parameters.iter().enumerate();
        let free = parameters.filter(|(_, p)| !p.fixed && names.contains(p.name.as_str()));
        free.map(|(k, _)| k).collect()
    }
}

/// Of groups of joints those that are in a limb, as its joints.
fn like_of_limb(groups: &[Vec<Joint>], limb: &[Joint]) -> Vec<Vec<Joint>> {
    let own = |joint: &Joint| limb.iter().position(|own| own == joint).map(Joint::at);
    let groups = groups.iter();
    groups
        .map(|group| group.iter().filter_map(own).collect())
        .filter(|group: &Vec<Joint>| group.len() > 1)
        .collect()
}

impl FittedEffect {
    /// The same effect on another joint.
    #[must_use]
    pub fn on(&self, joint: Joint) -> Self {
        Self {
            joint,
            ..self.clone()
        }
    }
}

impl Bodies {
    /// Gravity, and what the links that these joints move are made of.
    fn formulas_of(&self, joints: &[Joint]) -> impl Iterator<Item = &Located<Formula>> {
        let links = self.places.iter().zip(&self.bodies);
        let own = links.filter(|(place, _)| joints.contains(&place.joint));
        (self.gravity.iter()).chain(own.flat_map(|(_, body)| body.parts()))
    }

    /// The links of these joints alone.
    fn limb(&self, joints: &[Joint]) -> Self {
        let own = |link: &usize| joints.contains(&self.places[*link].joint);
        let links: Vec<usize> = (0..self.places.len()).filter(own).collect();
        let number = |link: usize| links.iter().position(|own| *own == link);
        let place = |link: &usize| {
            let place = &self.places[*link];
            let joint = joints.iter().position(|own| *own == place.joint);
            Place {
                parent: place.parent.and_then(number),
                joint: Joint::at(joint.expect("the link is one of theirs")),
                ..place.clone()
            }
        };
        Self {
            gravity: self.gravity.clone(),
            places: links.iter().map(place).collect(),
            bodies: links
                .iter()
                .map(|link| self.bodies[*link].clone())
                .collect(),
        }
    }
}

/// Joints in groups that are joined step by step.
struct Groups(Vec<Joint>);

impl Groups {
    fn of(joints: usize) -> Self {
        Self(Joint::all(joints).collect())
    }

    fn join(&mut self, a: Joint, b: Joint) {
        let (from, to) = (self.0[a].max(self.0[b]), self.0[a].min(self.0[b]));
        let of_from = self.0.iter_mut().filter(|group| **group == from);
        of_from.for_each(|group| *group = to);
    }

    fn listed(&self) -> Vec<Vec<Joint>> {
        let first: BTreeSet<Joint> = self.0.iter().copied().collect();
        let members = |group: Joint| {
            let joints = Joint::all(self.0.len());
            joints.filter(|joint| self.0[*joint] == group).collect()
        };
        first.into_iter().map(members).collect()
    }
}
