//! The bodies of a tree for other values of its model file's parameters.

use thiserror::Error;

use super::bodies_text::Bodies;
use super::body::Tree;
use super::closed_form::ClosedForm;
use super::equations::Kind;
use super::model_file::is_short;
use super::nearest::{Sum, nearest};
use super::spatial::{Inertia, PARTS, Parts};
use crate::data;

/// Why a tree has no bodies for the values of a model.
#[derive(Debug, Error)]
pub enum ValuesError {
    #[error(
        "the model has no parameter `{0}`: it was not made from this file; give the file that `residyn new` read, and the same last body"
    )]
    Missing(String),
    #[error(
        "no physical bodies have the model's values: the logs do not determine them; fit to motion that moves all links more"
    )]
    NoBodies,
}

/// For each joint, the inertia to add, in its frame, so that the parameters of the tree's model file have these
/// values. For a model in closed form, whose parameters are sums, the bodies nearest to the tree's are taken.
///
/// # Errors
/// A parameter without a value, or sums that no bodies have.
pub fn added(
    tree: &Tree,
    value: impl Fn(&str) -> Option<f64>,
) -> Result<Vec<Inertia>, ValuesError> {
    let value = |name: &str| value(name).ok_or_else(|| ValuesError::Missing(name.to_owned()));
    let now = parts_of(tree);
    let of_bodies = Bodies(tree).parameters();
    let has_bodies = of_bodies.iter().all(|(name, ..)| value(name).is_ok());
    let new = match is_short(tree) && !has_bodies {
        true => nearest(&now, &sums(tree, &now, value)?).ok_or(ValuesError::NoBodies)?,
        false => {
            let mut new = now.clone();
            for (name, kind, joint) in &of_bodies {
                new[*joint][kind.place()] = value(name)?;
            }
            new
        }
    };
    let added = now.iter().zip(&new).map(|(now, new)| {
        let size = now
            .iter()
            .chain(new)
            .fold(0.0_f64, |most, part| most.max(part.abs()));
        let added: Parts = std::array::from_fn(|k| match new[k] - now[k] {
            rounding if rounding.abs() <= ROUNDING * size => 0.0,
            added => added,
        });
        Inertia::of_parts(&added)
    });
    Ok(added.collect())
}

/// Differences up to this are rounding, relative to the largest part of a body.
const ROUNDING: f64 = 1e-13;

/// The parts of the body of each joint.
fn parts_of(tree: &Tree) -> Vec<Parts> {
    let joints = tree.joints.iter();
    joints
        .map(|joint| Kind::OF_BODY.map(|kind| kind.value(joint)))
        .collect()
}

/// The sums that make up the parameters of a small tree. A part that is zero in the file is in no sum and stays zero.
fn sums(
    tree: &Tree,
    now: &[Parts],
    value: impl Fn(&str) -> Result<f64, ValuesError>,
) -> Result<Vec<Sum>, ValuesError> {
    let closed = ClosedForm::of(tree);
    let sum = |(name, parts): (&str, Vec<(f64, Kind, data::Joint)>)| {
        let is_rotor = |(_, kind, _): &&(f64, Kind, data::Joint)| *kind == Kind::Rotor;
        let rotors = parts.iter().filter(is_rotor);
        let of_rotors: f64 = rotors
            .map(|(factor, kind, joint)| factor * kind.value(&tree.joints[*joint]))
            .sum();
        let bodies = parts.iter().filter(|part| !is_rotor(part));
        Ok(Sum {
            parts: bodies
                .map(|(factor, kind, joint)| (*factor, PARTS * joint.index() + kind.place()))
                .collect(),
            value: value(name)? - of_rotors,
        })
    };
    let mut sums: Vec<Sum> = closed.sums().map(sum).collect::<Result<_, _>>()?;
    let all = now.iter().flatten().enumerate();
    let zero = all.filter(|(_, part)| **part == 0.0).map(|(at, _)| Sum {
        parts: vec![(1.0, at)],
        value: 0.0,
    });
    sums.extend(zero);
    Ok(sums)
}
