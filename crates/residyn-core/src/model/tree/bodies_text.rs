//! A tree of any size as the table `[chain]` of a model file: frames, and the inertia of each link as parameters.

use std::fmt::Write;

use nalgebra::Vector3;

use super::body::{Joint, Tree, places};
use super::equations::Kind;
use super::formula::number;
use super::model_file::{gravity_parameter, name, parameter, quoted};
use super::recursive::Place;
use super::series::rounded;
use crate::data;

/// The bodies of a tree.
pub(super) struct Bodies<'c>(pub &'c Tree);

impl Bodies<'_> {
    /// Parameters and tree of the model file.
    pub fn text(&self) -> String {
        let mut text = "\n[parameters]\n".to_owned();
        for (number, joint) in self.links() {
            if has_inertia(joint) {
                text += &parameters(number, joint);
            }
        }
        if self.0.gravity.norm() > 0.0 {
            text += &gravity_parameter(self.0);
        }
        let _ = write!(text, "\n[chain]\ngravity = {}\n", self.gravity());
        let places = places(&self.0.joints);
        for ((number, joint), place) in self.links().zip(&places) {
            link(&mut text, number, joint, place);
        }
        text
    }

    /// The parameters of the bodies: name, kind and joint.
    pub fn parameters(&self) -> Vec<(String, Kind, data::Joint)> {
        let links = self.links().filter(|(_, joint)| has_inertia(joint));
        let all = |number| Kind::OF_BODY.map(|kind| (name(kind, number), kind, number));
        links.flat_map(|(number, _)| all(number)).collect()
    }

    /// The links with their numbers, which appear in the names of their parameters.
    fn links(&self) -> impl Iterator<Item = (data::Joint, &Joint)> {
        let joints = self.0.joints.iter().enumerate();
        joints.map(|(k, joint)| (data::Joint::at(k), joint))
    }

    /// `["0", "0", "-g"]`
    fn gravity(&self) -> String {
        let gravity = self.0.gravity;
        let direction = gravity.try_normalize(0.0).unwrap_or_default();
        list(direction.iter().map(|part| match rounded(*part) {
            0.0 => quoted("0"),
            1.0 => quoted("g"),
            -1.0 => quoted("-g"),
            part => quoted(&format!("{}*g", number(part))),
        }))
    }
}

/// A body without inertia has no parameters.
fn has_inertia(joint: &Joint) -> bool {
    joint.inertia.mass > 0.0 || joint.inertia.tensor.norm() > 0.0
}

fn parameters(number: data::Joint, joint: &Joint) -> String {
    let line = |kind: Kind| {
        let what = match kind {
            Kind::Mass | Kind::Rotor => "mass",
            Kind::Moment(_) => "mass times centre of mass",
            Kind::Tensor(..) => "inertia tensor",
        };
        let about = format!("{what} of {}", joint.body);
        let is_positive = kind.is_never_negative();
        parameter(kind, number, kind.value(joint), is_positive, &about)
    };
    Kind::OF_BODY.map(line).concat()
}

fn link(text: &mut String, number: data::Joint, joint: &Joint, place: &Place) {
    let column = |k: usize| vector(&place.pose.rotation.column(k).into());
    let names = |kinds: &[Kind]| {
        let name = |kind: &Kind| match has_inertia(joint) {
            true => quoted(&name(*kind, number)),
            false => quoted("0"),
        };
        list(kinds.iter().map(name))
    };
    let _ = write!(
        text,
        "\n[[chain.link]] # {}, moved by {}\njoint = {}\n{}{}origin = {}\naxis = {}\nacross = {}\nmass = {}\nmoment = {}\ninertia = {}\n",
        joint.body,
        joint.name,
        place.joint,
        parent(number, place),
        follows(joint, place),
        vector(&place.pose.origin),
        column(2),
        column(0),
        names(&[Kind::Mass]).trim_matches(['[', ']']),
        names(&Kind::OF_BODY[1..4]),
        names(&Kind::OF_BODY[4..])
    );
}

/// The number of the link that a link sits on, unless it is the one before; 0 for the base.
fn parent(number: data::Joint, place: &Place) -> String {
    let on = place.parent.map_or(0, |parent| parent + 1);
    match on == number.index() {
        true => String::new(),
        false => format!("parent = {on}\n"),
    }
}

/// How a link follows a joint that also moves another link.
fn follows(joint: &Joint, place: &Place) -> String {
    match joint.follows {
        Some(_) => format!(
            "ratio = {:?}\noffset = {:?}\nslides = {}\n",
            place.ratio, place.offset, place.slides
        ),
        None => String::new(),
    }
}

/// `[0.0, 0.0, 1.0]`
fn vector(vector: &Vector3<f64>) -> String {
    list(vector.iter().map(|part| format!("{:?}", rounded(*part))))
}

fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(", "))
}
