//! Reads a mechanism.

use std::collections::HashMap;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

use super::actuator::{self, Drive};
use super::classes::Classes;
use super::orientation::Angles;
use super::{equality, geom};
use crate::robot::element::Element;
use crate::robot::tree::{self, Body, Hinge, Mimics};
use crate::xml::{self, Source, elements, named};
use residyn_core::model::FileError;
use residyn_core::model::tree::{Drivetrain, Inertia, Pose, Spring, Tree};

/// Read the tree of an MJCF file, or its branch from the world to the body `tip`. A floating base is fixed, with a note.
///
/// # Errors
/// An unreadable file, invalid XML, anything but a tree of hinge and slide joints, or data outside of the file,
/// such as meshes: with line, column and remedy.
pub fn read_mjcf(path: &Path, tip: Option<&str>) -> Result<Tree, FileError> {
    let text = xml::text(path)?;
    let source = Source::new(path, &text)?;
    let reader = Reader::new(&source)?;
    let gravity = reader.gravity()?;
    let joints = tree::joints(&source, &reader.world()?, tip)?;
    reader.note_the_rest()?;
    let name = reader
        .root
        .attribute("model")
        .map_or_else(|| source.stem(), tree::plain);
    Ok(Tree {
        name,
        gravity,
        joints,
        drive: None,
        notes: source.into_notes(),
    })
}

/// Attributes of the compiler section that do not affect what is read here.
const COMPILER: &str = "\
    angle eulerseq autolimits coordinate inertiafromgeom strippath meshdir texturedir assetdir \
    discardvisual usethread fusestatic exactmeshinertia convexhull fitaabb alignfree saveinertial \
    balanceinertia";
/// Attributes of a joint that are read here or have no effect within its range.
const JOINT: &str = "\
    name class type group pos axis springdamper limited range actuatorfrclimited actuatorfrcrange \
    solreflimit solimplimit solreffriction solimpfriction stiffness margin ref springref armature \
    damping frictionloss user";
/// Attributes of a body that are read here or have no effect.
const BODY: &str = "name childclass pos quat axisangle euler xyaxes zaxis mocap user sleep";
/// Flags that switch off joint forces.
const FORCES: &[&str] = &["passive", "spring", "damper", "frictionloss"];

/// Whether a body floats on this joint.
fn is_free(joint: Node<'_, '_>) -> bool {
    joint.attribute("type") == Some("free")
}

pub(super) struct Reader<'s, 'x> {
    pub source: &'s Source<'x>,
    root: Node<'s, 'x>,
    classes: Classes<'s, 'x>,
    pub angles: Angles,
    autolimits: bool,
    /// `auto`, `true` or `false`.
    pub inertia_from_geom: String,
    /// Effort limit of the drive (N m or N), by joint.
    drives: HashMap<String, Drive>,
    /// What each follower joint follows, by the follower's name.
    mimics: HashMap<String, Mimics>,
}

impl<'s, 'x> Reader<'s, 'x> {
    pub fn new(source: &'s Source<'x>) -> Result<Self, FileError> {
        let root = source.root("mujoco")?;
        if let Some(include) = root.descendants().find(|node| node.has_tag_name("include")) {
            let message = "<include> is not followed; save the whole model as one file, with MuJoCo's mj_saveLastXML";
            return Err(source.error(include, message));
        }
        let compiler = Element::of_section(source, root, "compiler");
        for (key, remedy) in [
            ("boundmass", "give the masses in the bodies"),
            ("boundinertia", "give the inertias in the bodies"),
            ("settotalmass", "give the masses in the bodies"),
            ("inertiagrouprange", "give <inertial> in the bodies"),
        ] {
            compiler.refuse(key, remedy)?;
        }
        if compiler.text("coordinate") == Some("global") {
            compiler.refuse(
                "coordinate",
                "only local coordinates are read; convert the file with MuJoCo 2.3.3",
            )?;
        }
        compiler.note_others(COMPILER);
        let classes = Classes::new(source, root)?;
        let autolimits = compiler.text("autolimits") != Some("false");
        Ok(Self {
            angles: Angles::new(&compiler)?,
            inertia_from_geom: compiler
                .text("inertiafromgeom")
                .unwrap_or("auto")
                .to_owned(),
            drives: actuator::drives(source, root, &classes, autolimits)?,
            mimics: equality::mimics(source, root)?,
            source,
            root,
            classes,
            autolimits,
        })
    }

    /// The joint with this name.
    pub fn joint(&self, name: &str) -> Result<Node<'s, 'x>, FileError> {
        let worlds = named(self.root, "worldbody");
        let mut joints = worlds.flat_map(|world| world.descendants());
        joints
            .find(|node| node.has_tag_name("joint") && node.attribute("name") == Some(name))
            .ok_or_else(|| {
                let message = format!(
                    "no joint has the name `{name}`; give the joints of the model names, and make the model from the file again"
                );
                self.source.error(self.root, message)
            })
    }

    /// The default class of a body's elements.
    pub fn class_of(&self, body: Node<'s, 'x>) -> &'s str {
        let mut around = body.ancestors();
        let given = around.find_map(|node| node.attribute("childclass"));
        given.unwrap_or_else(|| self.classes.outermost())
    }

    /// A joint with its defaults.
    pub fn element(&self, joint: Node<'s, 'x>) -> Result<Element<'s, 'x>, FileError> {
        self.classes
            .element(joint, self.class_of(joint), &["joint"])
    }

    fn gravity(&self) -> Result<Vector3<f64>, FileError> {
        let option = Element::of_section(self.source, self.root, "option");
        for flag in named(self.root, "option").flat_map(|option| named(option, "flag")) {
            let off = |key: &str| flag.attribute(key) == Some("disable");
            if off("gravity") {
                return Ok(Vector3::zeros());
            }
            if let Some(force) = FORCES.iter().find(|force| off(force)) {
                let message = format!(
                    "`{force}` is switched off here; remove the switch, and what it switches off from the joints"
                );
                return Err(self.source.attribute_error(flag, force, message));
            }
        }
        for fluid in ["density", "viscosity"] {
            if option.number_or(fluid, 0.0)? != 0.0 {
                self.source.note(
                    self.root,
                    format!("fluid forces (`{fluid}`) are not carried"),
                );
            }
        }
        let given = option.numbers::<3>("gravity")?;
        Ok(Vector3::from(given.unwrap_or([0.0, 0.0, -9.81])))
    }

    /// All bodies, attached to one without joints.
    fn world(&self) -> Result<Body, FileError> {
        let mut children = Vec::new();
        for world in named(self.root, "worldbody") {
            children.extend(self.children(world, self.classes.outermost())?);
        }
        Ok(Body {
            name: "world".into(),
            at: self.root.range().start,
            pose: Pose::identity(),
            joints: Vec::new(),
            inertia: Ok(Inertia::none()),
            children,
        })
    }

    fn children(&self, of: Node<'s, 'x>, class: &str) -> Result<Vec<Body>, FileError> {
        named(of, "body")
            .map(|body| self.body(body, class))
            .collect()
    }

    /// A body with all its descendants; `class` is the default class of its parent.
    fn body(&self, node: Node<'s, 'x>, class: &str) -> Result<Body, FileError> {
        let class = node.attribute("childclass").unwrap_or(class);
        self.check_parts(node)?;
        let own = self.source.element(node);
        own.note_others(BODY);
        let name = node.attribute("name").unwrap_or("body").to_owned();
        let moving = named(node, "joint").filter(|joint| !is_free(*joint));
        let joints = moving.enumerate().map(|(k, joint)| {
            let fallback = format!("{name}_joint{}", k + 1);
            self.hinge(&self.classes.element(joint, class, &["joint"])?, &fallback)
        });
        Ok(Body {
            at: node.range().start,
            pose: Pose {
                rotation: self.angles.orientation(&own)?,
                origin: own.vector("pos")?,
            },
            joints: joints.collect::<Result<_, _>>()?,
            inertia: self.inertia(node, class, &name),
            children: self.children(node, class)?,
            name,
        })
    }

    fn check_parts(&self, body: Node<'s, 'x>) -> Result<(), FileError> {
        for part in elements(body) {
            let name = part.tag_name().name();
            if name == "freejoint" || name == "joint" && is_free(part) {
                let note =
                    "this body is free to move in the file; it is fixed where the file draws it";
                self.source.note(part, note.to_owned());
                continue;
            }
            let remedy = match name {
                "inertial" | "joint" | "geom" | "body" | "site" | "camera" | "light" => continue,
                _ => {
                    "which is not read; save the compiled model with MuJoCo's mj_saveLastXML, or remove it"
                }
            };
            let message = format!("<{name}> in a body: {remedy}");
            return Err(self.source.error(part, message));
        }
        Ok(())
    }

    fn hinge(&self, joint: &Element<'s, 'x>, fallback: &str) -> Result<Hinge, FileError> {
        let name = joint.text("name").unwrap_or(fallback).to_owned();
        let slides = match joint.text("type").unwrap_or("hinge") {
            "hinge" => Ok(false),
            "slide" => Ok(true),
            other => {
                let message = format!(
                    "joint `{name}` is of type `{other}`; only hinge and slide are known: fix the joint, or describe it by several"
                );
                Err(joint.error(message))
            }
        };
        joint.refuse("springdamper", "give `stiffness` and `damping`")?;
        joint.note_others(JOINT);
        if joint.limits("range", "limited", self.autolimits)?.is_some() {
            joint.note(format!("the range of `{name}` is not carried"));
        }
        let position = |key| {
            if slides == Ok(true) {
                joint.number_or(key, 0.0)
            } else {
                self.angles.angle(joint, key)
            }
        };
        let stiffness = linear(joint, "stiffness")?;
        let rest = position("springref")?;
        let reference = position("ref")?;
        Ok(Hinge {
            at: joint.at(),
            slides,
            axis: joint.direction("axis", Vector3::z())?,
            anchor: joint.vector("pos")?,
            reference,
            mimics: self.mimics.get(&name).cloned(),
            drivetrain: Drivetrain {
                damping: linear(joint, "damping")?,
                friction: joint.not_negative("frictionloss")?,
                armature: joint.not_negative("armature")?,
                spring: (stiffness > 0.0).then_some(Spring { stiffness, rest }),
                effort: self.effort(joint, &name)?,
                servo: self.drives.get(&name).and_then(|drive| drive.servo),
            },
            name,
        })
    }

    /// The smaller effort limit of the joint and its drive.
    fn effort(&self, joint: &Element<'s, 'x>, name: &str) -> Result<Option<f64>, FileError> {
        let range = joint.limits("actuatorfrcrange", "actuatorfrclimited", self.autolimits)?;
        let own = range.and_then(|range| actuator::symmetric(joint, range, "actuatorfrcrange"));
        let of_drive = self.drives.get(name).and_then(|drive| drive.effort);
        Ok([own, of_drive].into_iter().flatten().reduce(f64::min))
    }

    pub fn inertia(
        &self,
        body: Node<'s, 'x>,
        class: &str,
        name: &str,
    ) -> Result<Inertia, FileError> {
        let given = named(body, "inertial").next();
        let of_geoms = || {
            let mut sum = Inertia::none();
            for geom in named(body, "geom") {
                let geom = self.classes.element(geom, class, &["geom"])?;
                sum = sum.with(&geom::inertia(&geom, &self.angles, name)?);
            }
            Ok(sum)
        };
        match (self.inertia_from_geom.as_str(), given) {
            ("true", _) | ("auto", None) => of_geoms(),
            (_, None) => Ok(Inertia::none()),
            (_, Some(inertial)) => self.inertial(&self.source.element(inertial), name),
        }
    }

    fn inertial(&self, inertial: &Element<'s, 'x>, name: &str) -> Result<Inertia, FileError> {
        let mass = inertial.required("mass")?;
        let full = inertial.numbers::<6>("fullinertia")?;
        let tensor = match (full, inertial.numbers::<3>("diaginertia")?) {
            (Some([xx, yy, zz, xy, xz, yz]), _) => Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
            (None, Some(diagonal)) => Matrix3::from_diagonal(&Vector3::from(diagonal)),
            (None, None) => {
                return Err(
                    inertial.error("`diaginertia` or `fullinertia` is missing in <inertial>")
                );
            }
        };
        tree::check_inertia(self.source, inertial.at(), name, mass, &tensor)?;
        let pose = Pose {
            rotation: self.angles.orientation(inertial)?,
            origin: inertial.vector("pos")?,
        };
        Ok(Inertia::central(mass, tensor, &pose))
    }

    /// Note everything else in the file that affects the motion.
    fn note_the_rest(&self) -> Result<(), FileError> {
        let section = |name| named(self.root, name).flat_map(elements);
        for (name, what) in [
            ("tendon", "tendons"),
            ("deformable", "flexible bodies"),
            ("extension", "plugins"),
        ] {
            if let Some(first) = section(name).next() {
                self.source.note(first, format!("{what} are not carried"));
            }
        }
        if let Some(geom) = self.root.descendants().find(|node| is_of_body(*node)) {
            self.source.note(geom, "contacts are not carried");
        }
        Ok(())
    }
}

fn is_of_body(node: Node<'_, '_>) -> bool {
    node.has_tag_name("geom")
        && node
            .parent_element()
            .is_some_and(|p| p.has_tag_name("body"))
}

/// A linear coefficient; a polynomial's higher coefficients must be zero.
pub(super) fn linear(joint: &Element<'_, '_>, key: &str) -> Result<f64, FileError> {
    let all = joint.list(key)?.unwrap_or_default();
    if all.iter().skip(1).any(|higher| *higher != 0.0)
        || all.first().is_some_and(|first| *first < 0.0)
    {
        let message = format!(
            "`{key}` must be one number, zero or more; a polynomial is not carried, give its linear part"
        );
        return Err(joint.attribute_error(key, message));
    }
    Ok(all.first().copied().unwrap_or(0.0))
}
