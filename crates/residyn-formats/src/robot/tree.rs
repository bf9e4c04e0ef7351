//! A tree of bodies, each welded to its parent or attached by joints, and the joints that a model has.

use nalgebra::Vector3;

use crate::xml::Source;
use residyn_core::expr::{listed, suggestion};
use residyn_core::limits::JOINTS;
use residyn_core::model::tree::{
    Drivetrain, Follows, Inertia, Joint, Pose, fault, with_z_along, without_inertia,
};
use residyn_core::model::{FileError, FileRemedy};

/// A joint in the frame of the body that it moves.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Hinge {
    pub name: String,
    /// Position in the file, bytes.
    pub at: usize,
    /// Whether it slides rather than turns; or why it does neither.
    pub slides: Result<bool, FileError>,
    /// A unit vector.
    pub axis: Vector3<f64>,
    /// A point of the axis, m.
    pub anchor: Vector3<f64>,
    pub reference: f64,
    /// The joint that it follows, if any.
    pub mimics: Option<Mimics>,
    pub drivetrain: Drivetrain,
}

/// Another joint's coordinate times `ratio` plus `offset` (rad or m), both from their references.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mimics {
    /// Its name.
    pub leader: String,
    pub ratio: f64,
    pub offset: f64,
}

/// A body with its descendants.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Body {
    pub name: String,
    pub at: usize,
    /// In the frame of the parent, joints at their references.
    pub pose: Pose,
    /// From the parent outwards; none if it is welded to the parent.
    pub joints: Vec<Hinge>,
    /// In the body's own frame, or what is wrong with it.
    pub inertia: Result<Inertia, FileError>,
    pub children: Vec<Body>,
}

impl Body {
    /// Its name and those of all its descendants.
    pub fn names(&self) -> Vec<&str> {
        let below = self.children.iter().flat_map(Self::names);
        std::iter::once(self.name.as_str()).chain(below).collect()
    }

    /// Whether this is the body of that name, or an ancestor of it.
    pub fn holds(&self, name: &str) -> bool {
        self.name == name || self.children.iter().any(|child| child.holds(name))
    }
}

/// The joints of the whole tree or, with a `tip`, those from the base to the body of that name: bodies on other branches
/// are then welded where the file draws them, with a note.
///
/// # Errors
/// An unknown tip, no joint or too many, joints that move no inertia, a joint that follows one that is left out.
pub(crate) fn joints(
    source: &Source<'_>,
    base: &Body,
    tip: Option<&str>,
) -> Result<Vec<Joint>, FileError> {
    let path = tip.map(|tip| path_to(source, base, tip)).transpose()?;
    let mut growth = Growth {
        source,
        path,
        joints: Vec::new(),
        hinges: Vec::new(),
    };
    growth.grow(base, &Pose::identity(), None)?;
    growth.link_followers()?;
    let Growth { joints, hinges, .. } = growth;
    if joints.is_empty() {
        let message = "no joint moves; give a mechanism of revolute, continuous or prismatic joints (hinge or slide in MJCF)";
        return Err(source.error_at(base.at, message));
    }
    if let Some(light) = without_inertia(&joints) {
        let message = format!(
            "joint `{}` moves nothing that has inertia; give <inertial> of `{}` or of its descendants",
            light.name, light.body
        );
        let mut all = hinges.iter();
        let at = all
            .find(|hinge| hinge.name == light.name)
            .map(|hinge| hinge.at);
        return Err(source.error_at(at.unwrap_or(base.at), message));
    }
    Ok(joints)
}

/// The bodies from the base to the tip.
fn path_to<'b>(source: &Source<'_>, base: &'b Body, tip: &str) -> Result<Vec<&'b Body>, FileError> {
    let mut path = vec![base];
    while let Some(last) = path.last().filter(|body| body.name != tip) {
        let Some(next) = last.children.iter().find(|child| child.holds(tip)) else {
            let names = base.names();
            let near = suggestion(tip, names.iter().copied());
            let message = format!("there is no body `{tip}`{near}; it has {}", listed(names));
            return Err(source.error_at(base.at, message));
        };
        path.push(next);
    }
    Ok(path)
}

/// A name with only the characters of file names and columns.
pub(crate) fn plain(name: &str) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() || c == '-' {
            c
        } else {
            '_'
        }
    };
    name.chars().map(plain).collect()
}

/// A tree under construction.
struct Growth<'t, 's, 'x> {
    source: &'s Source<'x>,
    /// The bodies from the base to the tip, if the joints of others are left out.
    path: Option<Vec<&'t Body>>,
    joints: Vec<Joint>,
    /// The hinges that the joints come from.
    hinges: Vec<&'t Hinge>,
}

impl<'t> Growth<'t, '_, '_> {
    /// Add a body and its descendants. `parent` is its parent's frame in the frame of joint `last`, or in the world.
    fn grow(
        &mut self,
        body: &'t Body,
        parent: &Pose,
        mut last: Option<usize>,
    ) -> Result<(), FileError> {
        let mut frame = parent.then(&body.pose);
        for hinge in &body.joints {
            self.check_room(hinge)?;
            let own = Pose {
                rotation: with_z_along(hinge.axis),
                origin: hinge.anchor,
            };
            let joint = joint(body, hinge, last, frame.then(&own))?;
            last = Some(self.joints.len());
            self.hinges.push(hinge);
            self.joints.push(joint);
            frame = own.inverse();
        }
        self.take(body, &frame, last)?;
        for child in &body.children {
            match self.is_kept(child) {
                true => self.grow(child, &frame, last)?,
                false => self.weld(child, &frame, last)?,
            }
        }
        Ok(())
    }

    fn is_kept(&self, body: &Body) -> bool {
        let is_on = |path: &Vec<&Body>| path.iter().any(|other| std::ptr::eq(*other, body));
        self.path.as_ref().is_none_or(is_on)
    }

    fn check_room(&self, hinge: &Hinge) -> Result<(), FileError> {
        let leads = |hinge: &Hinge| hinge.mimics.is_none();
        let leaders = self.hinges.iter().filter(|hinge| leads(hinge)).count();
        if leaders < JOINTS || !leads(hinge) {
            return Ok(());
        }
        let message = format!(
            "joint `{}` is one too many: at most {JOINTS} are read; name the last body of one limb, or fix the joints that the rig does not use",
            hinge.name
        );
        let error = self.source.error_at(hinge.at, message);
        Err(error.remedied_by(FileRemedy::Tip))
    }

    /// Add a body off the path and its descendants to what joint `last` moves.
    fn weld(&mut self, body: &Body, parent: &Pose, last: Option<usize>) -> Result<(), FileError> {
        for hinge in &body.joints {
            let note = format!(
                "joint `{}` is not on the way to the tip: `{}` is held where the file draws it",
                hinge.name, body.name
            );
            self.source.note_at(hinge.at, note);
        }
        let frame = parent.then(&body.pose);
        self.take(body, &frame, last)?;
        let mut children = body.children.iter();
        children.try_for_each(|child| self.weld(child, &frame, last))
    }

    /// Add a body's inertia to what joint `last` moves, if there is one; `frame` is the body's frame in the joint's.
    fn take(&mut self, body: &Body, frame: &Pose, last: Option<usize>) -> Result<(), FileError> {
        if let Some(last) = last {
            let own = body.inertia.clone()?;
            let last = &mut self.joints[last];
            last.inertia = last.inertia.with(&own.seen_from(frame));
        }
        Ok(())
    }

    /// Find the leaders of joints that follow others.
    fn link_followers(&mut self) -> Result<(), FileError> {
        for (k, hinge) in self.hinges.iter().enumerate() {
            let Some(mimics) = &hinge.mimics else {
                continue;
            };
            let mut leaders = self.hinges.iter();
            let is_leader = |other: &&Hinge| other.name == mimics.leader && other.mimics.is_none();
            let Some(leader) = leaders.position(is_leader) else {
                let message = format!(
                    "joint `{}` follows `{}`, which is not an independent joint of the model; name another last body, or fix the joint",
                    hinge.name, mimics.leader
                );
                let error = self.source.error_at(hinge.at, message);
                return Err(error.remedied_by(FileRemedy::Tip));
            };
            if hinge.drivetrain != Drivetrain::default() {
                let note = format!(
                    "what acts on `{}` itself is not carried: it follows `{}`",
                    hinge.name, mimics.leader
                );
                self.source.note_at(hinge.at, note);
            }
            self.joints[k].follows = Some(Follows {
                leader,
                ratio: mimics.ratio,
                offset: mimics.offset + hinge.reference
                    - mimics.ratio * self.hinges[leader].reference,
            });
        }
        Ok(())
    }
}

fn joint(
    body: &Body,
    hinge: &Hinge,
    parent: Option<usize>,
    pose: Pose,
) -> Result<Joint, FileError> {
    Ok(Joint {
        name: hinge.name.clone(),
        body: body.name.clone(),
        parent,
        slides: hinge.slides.clone()?,
        pose,
        reference: hinge.reference,
        across: with_z_along(hinge.axis).column(0).into(),
        axis: hinge.axis,
        anchor: hinge.anchor,
        inertia: Inertia::none(),
        follows: None,
        drivetrain: hinge.drivetrain,
    })
}

/// Refuse a mass (kg) or an inertia tensor (kg m^2, about the centre of mass) that no body can have; `at` is its position
/// in the file.
pub(crate) fn check_inertia(
    source: &Source<'_>,
    at: usize,
    body: &str,
    mass: f64,
    tensor: &nalgebra::Matrix3<f64>,
) -> Result<(), FileError> {
    if mass < 0.0 {
        let message = format!("the mass of `{body}` is {mass}; give one above zero");
        return Err(source.error_at(at, message));
    }
    fault(tensor).map_or(Ok(()), |fault| {
        let message = format!(
            "the inertia of `{body}` about its centre of mass {fault}, which no physical body has; correct it"
        );
        Err(source.error_at(at, message))
    })
}
