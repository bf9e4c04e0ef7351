//! Reads a mechanism: links, each attached to its parent by one joint.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use roxmltree::{Node, NodeId};

use crate::robot::tree::{self, Body, Hinge, Mimics};
use crate::xml::{self, Source, named};
use residyn_core::limits::XML_DEPTH;
use residyn_core::model::FileError;
use residyn_core::model::tree::{Drivetrain, Inertia, Pose, Tree, turn};

/// Gravity, which the format does not contain: m/s^2, against z.
pub(super) const GRAVITY: f64 = 9.81;

/// Read the tree of a URDF file, or its branch from the root to the link `tip`. A floating base is fixed, with a note.
/// Gravity acts against z of the root link.
///
/// # Errors
/// An unreadable file, invalid XML, or anything but a tree of revolute, continuous or prismatic joints: with
/// line, column and remedy.
pub fn read_urdf(path: &Path, tip: Option<&str>) -> Result<Tree, FileError> {
    let text = xml::text(path)?;
    let source = Source::new(path, &text)?;
    let file = Robot::new(&source)?;
    let base = file.base()?;
    let tree = file.body(base, None, &file.joints_below()?, 0)?;
    file.check_all_hang_on(&tree)?;
    let joints = tree::joints(&source, &tree, tip)?;
    file.note_the_rest();
    let name = file
        .root
        .attribute("name")
        .map_or_else(|| source.stem(), tree::plain);
    Ok(Tree {
        name,
        gravity: Vector3::new(0.0, 0.0, -GRAVITY),
        joints,
        drive: None,
        notes: source.into_notes(),
    })
}

pub(super) struct Robot<'s, 'x> {
    pub source: &'s Source<'x>,
    root: Node<'s, 'x>,
    /// By name; the first, if several share a name.
    links: HashMap<&'s str, Node<'s, 'x>>,
}

/// The joints attached to each link, in the order of the file.
type JointsBelow<'s, 'x> = HashMap<NodeId, Vec<Node<'s, 'x>>>;

impl<'s, 'x> Robot<'s, 'x> {
    pub fn new(source: &'s Source<'x>) -> Result<Self, FileError> {
        let root = source.root("robot")?;
        let mut links = HashMap::new();
        for link in named(root, "link") {
            if let Some(name) = link.attribute("name") {
                links.entry(name).or_insert(link);
            }
        }
        Ok(Self {
            source,
            root,
            links,
        })
    }

    /// The joint with this name.
    pub fn joint(&self, name: &str) -> Result<Node<'s, 'x>, FileError> {
        let mut joints = named(self.root, "joint");
        joints
            .find(|joint| joint.attribute("name") == Some(name))
            .ok_or_else(|| {
                let message = format!("there is no joint `{name}`; correct the name");
                self.source.error(self.root, message)
            })
    }

    /// The root link, which is the child of no joint.
    fn base(&self) -> Result<Node<'s, 'x>, FileError> {
        let mut children = HashSet::new();
        for joint in named(self.root, "joint") {
            let link = self.end(joint, "child")?;
            if !children.insert(link.id()) {
                let message =
                    "this joint closes a loop: its child has a parent already; open the loop";
                return Err(self.source.error(joint, message));
            }
        }
        let mut bases = named(self.root, "link").filter(|link| !children.contains(&link.id()));
        let Some(base) = bases.next() else {
            let message = "no link is the root, a link that is the child of no joint; give one";
            return Err(self.source.error(self.root, message));
        };
        match bases.next() {
            None => Ok(base),
            Some(other) => {
                let message = "a second link that is the child of no joint; join it to the others";
                Err(self.source.error(other, message))
            }
        }
    }

    /// The link that a joint's `<parent>` or `<child>` names.
    pub fn end(&self, joint: Node<'s, 'x>, which: &'static str) -> Result<Node<'s, 'x>, FileError> {
        let Some(end) = named(joint, which).next() else {
            return Err(self
                .source
                .error(joint, format!("<{which}> is missing in this joint")));
        };
        let name = self.source.element(end).required_text("link")?;
        self.links.get(name).copied().ok_or_else(|| {
            let message = format!("there is no link `{name}`; correct the name");
            self.source.attribute_error(end, "link", message)
        })
    }

    fn joints_below(&self) -> Result<JointsBelow<'s, 'x>, FileError> {
        let mut below = JointsBelow::new();
        for joint in named(self.root, "joint") {
            let parent = self.end(joint, "parent")?;
            below.entry(parent.id()).or_default().push(joint);
        }
        Ok(below)
    }

    /// A link with all its descendants, attached by `joint`, `depth` joints from the root.
    fn body(
        &self,
        link: Node<'s, 'x>,
        joint: Option<Node<'s, 'x>>,
        below: &JointsBelow<'s, 'x>,
        depth: usize,
    ) -> Result<Body, FileError> {
        if depth > XML_DEPTH {
            let message = format!(
                "this link is behind more than {XML_DEPTH} joints; merge links that are fixed to each other"
            );
            return Err(self.source.error(link, message));
        }
        let (pose, joints) = match joint {
            Some(joint) => (self.pose(joint)?, self.hinge(joint)?),
            None => (Pose::identity(), None),
        };
        let joints_below = below.get(&link.id()).into_iter().flatten();
        let children = joints_below.map(|joint| {
            let child = self.end(*joint, "child")?;
            self.body(child, Some(*joint), below, depth + 1)
        });
        let children = children.collect::<Result<_, _>>()?;
        Ok(Body {
            name: self.source.element(link).required_text("name")?.to_owned(),
            at: joint.unwrap_or(link).range().start,
            pose,
            joints: joints.into_iter().collect(),
            inertia: self.inertia(link),
            children,
        })
    }

    /// Refuse links in a loop, which no path from the root reaches.
    fn check_all_hang_on(&self, tree: &Body) -> Result<(), FileError> {
        let names: HashSet<&str> = tree.names().into_iter().collect();
        let hangs =
            |link: &Node<'s, 'x>| names.contains(link.attribute("name").unwrap_or_default());
        named(self.root, "link")
            .find(|link| !hangs(link))
            .map_or(Ok(()), |link| {
                let message =
                    "this link is not connected to the root: its joints form a loop; open the loop";
                Err(self.source.error(link, message))
            })
    }

    /// `<origin>` of an element: rotations about the fixed x, then y, then z.
    pub fn pose(&self, of: Node<'s, 'x>) -> Result<Pose, FileError> {
        let Some(origin) = named(of, "origin").next() else {
            return Ok(Pose::identity());
        };
        let origin = self.source.element(origin);
        let [roll, pitch, yaw] = origin.angles("rpy")?.unwrap_or_default();
        Ok(Pose {
            rotation: turn(Vector3::z(), yaw)
                * turn(Vector3::y(), pitch)
                * turn(Vector3::x(), roll),
            origin: origin.vector("xyz")?,
        })
    }

    pub fn inertia(&self, link: Node<'s, 'x>) -> Result<Inertia, FileError> {
        let Some(inertial) = named(link, "inertial").next() else {
            return Ok(Inertia::none());
        };
        let part = |name| {
            let missing = || {
                self.source
                    .error(inertial, format!("<{name}> is missing in <inertial>"))
            };
            let part = named(inertial, name).next().ok_or_else(missing)?;
            Ok::<_, FileError>(self.source.element(part))
        };
        let mass = part("mass")?.required("value")?;
        let inertia = part("inertia")?;
        let entry = |key| inertia.required(key);
        let (xy, xz, yz) = (entry("ixy")?, entry("ixz")?, entry("iyz")?);
        #[rustfmt::skip]
        let tensor = Matrix3::new(
            entry("ixx")?, xy, xz,
            xy, entry("iyy")?, yz,
            xz, yz, entry("izz")?,
        );
        let name = link.attribute("name").unwrap_or_default();
        tree::check_inertia(self.source, inertia.at(), name, mass, &tensor)?;
        Ok(Inertia::central(mass, tensor, &self.pose(inertial)?))
    }

    /// A joint that moves; none if it is fixed.
    fn hinge(&self, joint: Node<'s, 'x>) -> Result<Option<Hinge>, FileError> {
        let (source, element) = (self.source, self.source.element(joint));
        let name = element.required_text("name")?;
        let slides = match element.required_text("type")? {
            "fixed" => return Ok(None),
            "floating" => {
                element.note(format!(
                    "`{name}` floats; its child is fixed where the file draws it"
                ));
                return Ok(None);
            }
            "revolute" | "continuous" => Ok(false),
            "prismatic" => Ok(true),
            other => {
                let message = format!(
                    "joint `{name}` is of type `{other}`; only fixed, floating, revolute, continuous and prismatic are known: fix the joint, or describe it by several"
                );
                Err(element.attribute_error("type", message))
            }
        };
        let mimic = named(joint, "mimic").next().map(|mimic| {
            let mimic = source.element(mimic);
            Ok::<_, FileError>(Mimics {
                leader: mimic.required_text("joint")?.to_owned(),
                ratio: mimic.number_or("multiplier", 1.0)?,
                offset: mimic.number_or("offset", 0.0)?,
            })
        });
        let axis = match named(joint, "axis").next() {
            Some(axis) => source.element(axis).direction("xyz", Vector3::x())?,
            None => Vector3::x(),
        };
        let mut drivetrain = Drivetrain::default();
        if let Some(dynamics) = named(joint, "dynamics").next() {
            let dynamics = source.element(dynamics);
            drivetrain.damping = dynamics.not_negative("damping")?;
            drivetrain.friction = dynamics.not_negative("friction")?;
        }
        drivetrain.effort = self.effort(joint)?;
        Ok(Some(Hinge {
            name: name.to_owned(),
            at: element.at(),
            slides,
            axis,
            anchor: Vector3::zeros(),
            reference: 0.0,
            mimics: mimic.transpose()?,
            drivetrain,
        }))
    }

    /// The effort limit, if above zero; a range of positions is noted.
    fn effort(&self, joint: Node<'s, 'x>) -> Result<Option<f64>, FileError> {
        let Some(limit) = named(joint, "limit").next() else {
            return Ok(None);
        };
        let limit = self.source.element(limit);
        let name = joint.attribute("name").unwrap_or_default();
        let (low, high) = (
            limit.number_or("lower", 0.0)?,
            limit.number_or("upper", 0.0)?,
        );
        if low < high && joint.attribute("type") != Some("continuous") {
            limit.note(format!(
                "the range of `{name}`, {low} to {high}, is not carried"
            ));
        }
        if limit.text("velocity").is_some() {
            limit.note(format!("the velocity limit of `{name}` is not carried"));
        }
        let effort = limit.not_negative("effort")?;
        if limit.text("effort").is_some() && effort == 0.0 {
            limit.note(format!(
                "the effort limit of `{name}` is 0 and is not carried"
            ));
        }
        Ok((effort > 0.0).then_some(effort))
    }

    /// Note everything else in the file that affects the motion.
    fn note_the_rest(&self) {
        let source = self.source;
        let all = || self.root.descendants();
        if let Some(collision) = all().find(|node| node.has_tag_name("collision")) {
            source.note(collision, "contacts are not carried");
        }
        for transmission in named(self.root, "transmission") {
            source.note(
                transmission,
                "transmissions are not carried: tau is the torque or force at the joint",
            );
        }
        for safety in all().filter(|node| node.has_tag_name("safety_controller")) {
            source.note(safety, "safety controllers are not carried");
        }
        for extension in ["gazebo", "mujoco"] {
            if let Some(node) = named(self.root, extension).next() {
                source.note(node, format!("<{extension}> extensions are not read"));
            }
        }
    }
}
