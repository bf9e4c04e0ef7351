//! Writes a model's values back into the robot description that it was made from.

use std::path::Path;

use roxmltree::Node;

use super::edit::{Edit, same};
use super::value;
use crate::xml::Source;
use crate::{FORMATS, Format, xml};
use residyn_core::data::Joint;
use residyn_core::model::tree::{Drivetrain, Inertia, Tree, ValuesError, added, fault, model_text};
use residyn_core::model::{FileError, FileRemedy, FittedEffect, Library, Model};

/// A model's changes to a joint of the description and to the body that it moves.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Change {
    /// The joint, as the file names it.
    pub joint: String,
    /// Only damping, friction and armature differ from the file's.
    pub drivetrain: Drivetrain,
    /// Inertia added to its body, in the body's frame.
    pub added: Inertia,
}

/// A robot description with the values of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct WrittenBack {
    pub text: String,
    /// Parts of the model that the format cannot hold.
    pub not_carried: Vec<String>,
}

/// Effects that drivetrains hold: their one parameter is an attribute of the joint.
const DAMPING: &str = "viscous_friction";
const FRICTION: &str = "coulomb_friction";
const ROTOR: &str = "rotor_inertia";

/// Largest difference between the two accelerations of a joint, relative to the largest acceleration.
const ROUNDING: f64 = 1e-9;

/// The file that a model was made from, with the model's inertias, damping, dry friction and rotors in place of its
/// own. Everything else in it stays as it is. `tip` is the last link, as given when the model was made.
///
/// # Errors
/// A file that cannot be read, has an unknown format, or is not the one that the model was made from: other joints,
/// parameters or equations; values that no body can have.
pub fn write_back(model: &Model, file: &Path, tip: Option<&str>) -> Result<WrittenBack, FileError> {
    let text = xml::text(file)?;
    let source = Source::new(file, &text)?;
    let format = format(&source)?;
    let robots = format.robots.as_ref().expect("it was found by what it has");
    let tree = (robots.read)(file, tip)?;
    let refused = |message: String| FileError::new(file, None, message);
    let of_other_file = |message| refused(message).remedied_by(FileRemedy::Tip);
    let model = model.absorbed();
    check_joints(&model, &tree).map_err(of_other_file)?;
    let library = Library::built_in();
    let declared = Model::from_text(file, &model_text(&tree), library.effects())?;
    let value = |name: &str| value(&model.parameters, name);
    let added = added(&tree, value).map_err(|error| match error {
        ValuesError::Missing(_) => of_other_file(error.to_string()),
        ValuesError::NoBodies => refused(error.to_string()),
    })?;
    check_equations(&model, &declared).map_err(refused)?;
    let changes = changes(&model, &declared, &tree, &added);
    let mut edit = Edit::of(&text);
    (robots.rewrite)(&source, &mut edit, &changes)?;
    Ok(WrittenBack {
        text: edit.finished(),
        not_carried: not_carried(&model, &declared, robots.effects),
    })
}

/// The format of a robot description, by its root element.
pub(crate) fn format(source: &Source<'_>) -> Result<&'static Format, FileError> {
    let root = source.document_root();
    let is_its = |format: &&&Format| {
        let robots = format.robots.as_ref();
        robots.is_some_and(|robots| root.has_tag_name(robots.root))
    };
    FORMATS.iter().find(is_its).copied().ok_or_else(|| {
        let found = root.tag_name().name();
        let message =
            format!("the root element is <{found}>; give a URDF (<robot>) or an MJCF (<mujoco>)");
        source.error(root, message)
    })
}

/// Refuse a file whose joints are not those of the model.
fn check_joints(model: &Model, tree: &Tree) -> Result<(), String> {
    let of_file: Vec<&str> = tree
        .leaders()
        .map(|(_, joint)| joint.name.as_str())
        .collect();
    let of_model: Vec<&str> = model.joint_names.iter().map(String::as_str).collect();
    if of_file == of_model {
        return Ok(());
    }
    Err(format!(
        "the file has the joints {}, {} has {}; give the file that the model was made from, and the same last body",
        of_file.join(", "),
        model.name,
        match of_model[..] {
            [] => "none by name".to_owned(),
            _ => of_model.join(", "),
        }
    ))
}

/// Refuse a file with other equations: the model's and the file's must give the same accelerations for the same values.
fn check_equations(model: &Model, declared: &Model) -> Result<(), String> {
    let bare = |model: &Model| model.without_drive().with_effects(Vec::new()).dynamics();
    let [own, of_file] = [model, declared].map(bare);
    let values: Vec<f64> = (of_file.parameters.iter())
        .map(|p| value(&own.parameters, &p.name).unwrap_or(p.value))
        .collect();
    let n = model.joints;
    let differs = (0..10).any(|point| {
        // Positions, velocities and torques, then the time.
        let moving = (0..3 * n).map(|k| f64::from(point + 1) * (1.0 + k as f64).sin());
        let moving: Vec<f64> = moving.chain([0.0]).collect();
        let rates = |program: &residyn_core::expr::Program, values: &[f64]| {
            program.eval(&[&moving, values].concat())[n..2 * n].to_vec()
        };
        let [own, of_file] = [
            rates(&own.program, &own.values()),
            rates(&of_file.program, &values),
        ];
        let size = own.iter().fold(0.0_f64, |most, rate| most.max(rate.abs()));
        own.iter()
            .zip(&of_file)
            .any(|(a, b)| !((a - b).abs() <= ROUNDING * size))
    });
    match differs {
        true => Err(format!(
            "its frames are not those of {}, whose equations give other accelerations for the same values; give the file that the model was made from",
            model.name
        )),
        false => Ok(()),
    }
}

fn changes(model: &Model, declared: &Model, tree: &Tree, added: &[Inertia]) -> Vec<Change> {
    let mut numbers = Joint::all(model.joints);
    let drivetrain = |joint: &residyn_core::model::tree::Joint, number: Joint| Drivetrain {
        damping: sum(model, DAMPING, number),
        friction: sum(model, FRICTION, number),
        // In a small model, some rotors are part of other parameters.
        armature: joint.drivetrain.armature + sum(model, ROTOR, number)
            - sum(declared, ROTOR, number),
        ..joint.drivetrain
    };
    let joints = tree.joints.iter().zip(added);
    joints
        .map(|(joint, added)| Change {
            joint: joint.name.clone(),
            drivetrain: match joint.follows {
                Some(_) => joint.drivetrain,
                None => drivetrain(joint, numbers.next().expect("as many as leaders")),
            },
            added: added.seen_from(&joint.in_body()),
        })
        .collect()
}

/// The sum of the values of all effects with this name on a joint.
fn sum(model: &Model, name: &str, joint: Joint) -> f64 {
    let effects = model.effects.iter();
    let own = effects.filter(|effect| effect.effect.name == name && effect.joint == joint);
    own.map(|effect| effect.values[0].0).sum()
}

/// The effects that the format cannot hold and the file did not have before.
fn not_carried(model: &Model, declared: &Model, held: &[&str]) -> Vec<String> {
    let is_in_file = |effect: &FittedEffect| {
        let same_values = |other: &FittedEffect| {
            let pairs = effect.values.iter().zip(&other.values);
            effect.is_same(other) && pairs.into_iter().all(|((a, _), (b, _))| same(*a, *b))
        };
        declared.effects.iter().any(same_values)
    };
    let lost = model
        .effects
        .iter()
        .filter(|effect| !held.contains(&effect.effect.name.as_str()) && !is_in_file(effect));
    let text = |effect: &FittedEffect| {
        let names = effect
            .effect
            .parameters
            .iter()
            .map(|parameter| &parameter.name);
        let values = names
            .zip(&effect.values)
            .map(|(name, (value, _))| format!("{name} = {value:.5}"));
        format!(
            "{}: {}",
            effect.label(),
            values.collect::<Vec<_>>().join(", ")
        )
    };
    lost.map(text).collect()
}

/// The body of `link` with what is added: mass, centre of mass, and the tensor about it in the axes of the body.
///
/// # Errors
/// Values that no body can have.
pub(crate) fn body(
    source: &Source<'_>,
    link: Node<'_, '_>,
    whole: &Inertia,
) -> Result<(nalgebra::Vector3<f64>, nalgebra::Matrix3<f64>), FileError> {
    let (centre, tensor) = whole.about_centre();
    let fault = match whole.mass > 0.0 {
        true => fault(&tensor),
        false => Some("belongs to a mass that is not above zero"),
    };
    match fault {
        None => Ok((centre, tensor)),
        Some(fault) => {
            let name = link.attribute("name").unwrap_or_default();
            let message = format!(
                "with the model's values the inertia of `{name}` {fault}, which no physical body has: the logs do not determine it; fit to \
                 motion that moves it more"
            );
            Err(source.error(link, message))
        }
    }
}

/// Whether something is added.
pub(crate) fn is_some(added: &Inertia) -> bool {
    *added != Inertia::none()
}
