//! Columns that do not hold what the model file says, and the lines under `[columns]` that fix this.
//!
//! One file per kind. They are checked in turn, each on the log with the earlier fixes applied: an angle cannot be
//! judged before its turns are counted, nor a speed before the time is in seconds.

mod degrees;
mod sign;
mod time;
mod turns;
mod velocity;

use std::borrow::Cow;

use super::joint::{JointAudit, audit_joints};
use super::motion::Motion;
use super::quality::{Finding, Remedy, Severity};
use super::table::short;
use crate::data::column::{Quantity, unwrap};
use crate::data::columns::Columns;
use crate::data::local_cubic::slopes;
use crate::data::{Joint, Log};

/// A log and what its joints look like.
pub(super) struct Reading<'l> {
    pub log: Cow<'l, Log>,
    pub joints: Vec<JointAudit>,
    /// The motions in which accelerations are compared with torques.
    motions: Vec<Motion>,
}

/// One way in which columns are misread.
struct Misread {
    joint: Option<Joint>,
    text: String,
    changes: Vec<Change>,
}

/// One change of one column.
struct Change {
    quantity: Quantity,
    /// `None` for the time.
    joint: Option<Joint>,
    to: To,
}

#[derive(Clone, Copy)]
enum To {
    Unit(&'static str),
    Opposite,
    Wrapped,
    /// Velocities of all joints from the angles.
    Derived,
}

/// The kinds, in the order in which they are checked.
const KINDS: [fn(&Reading<'_>) -> Vec<Misread>; 5] = [
    turns::misread,
    time::misread,
    velocity::misread,
    degrees::misread,
    sign::misread,
];

/// What is misread in a log, as findings, and the log as it is meant, if that differs.
pub(super) fn as_meant<'l>(
    read: &Reading<'l>,
    columns: &Columns,
) -> (Option<Reading<'l>>, Vec<Finding>) {
    let (mut meant, mut found) = (None, vec![]);
    for kind in KINDS {
        let reading: &Reading<'l> = meant.as_ref().unwrap_or(read);
        let misread = kind(reading);
        if misread.is_empty() {
            continue;
        }
        let mut log = (*reading.log).clone();
        let changes = misread.iter().flat_map(|one| &one.changes);
        changes.for_each(|change| change.apply(&mut log));
        meant = Some(Reading::of(Cow::Owned(log), columns));
        found.extend(misread);
    }
    let findings = with_remedies(&found, columns, read.log.joints());
    (meant, findings)
}

/// The finding that all torques or commands have the opposite sign: reversed, they leave the declared model this share
/// of its error.
pub fn reversed_driving(
    share: f64,
    columns: &Columns,
    driven_by: Quantity,
    joints: usize,
) -> Finding {
    let opposite = |joint| Change::of(joint, driven_by, To::Opposite);
    let key = driven_by.key();
    let misread = Misread {
        joint: None,
        text: format!(
            "with every {key} reversed, the error of the declared model with friction falls to {} %: all of them seem \
             to have the opposite sign",
            short(100.0 * share)
        ),
        changes: Joint::all(joints).map(opposite).collect(),
    };
    with_remedies(&[misread], columns, joints).remove(0)
}

impl<'l> Reading<'l> {
    pub fn of(log: Cow<'l, Log>, columns: &Columns) -> Self {
        let (joints, motions) = audit_joints(&log, columns);
        Self {
            log,
            joints,
            motions,
        }
    }
}

/// Findings whose lines hold all changes together, so that each line is right together with the others.
fn with_remedies(found: &[Misread], columns: &Columns, joints: usize) -> Vec<Finding> {
    let mut mended = columns.whole(joints);
    for change in found.iter().flat_map(|one| &one.changes) {
        if let Some(columns) = &mut mended {
            change.mend(columns);
        }
    }
    let finding = |one: &Misread| {
        let mut lines: Vec<String> = vec![];
        for change in &one.changes {
            lines.extend(mended.iter().map(|columns| columns.line(change.quantity)));
        }
        lines.dedup();
        Finding {
            joint: one.joint,
            remedy: Some(Remedy::Columns(lines)),
            ..Finding::new(Severity::Serious, one.text.clone())
        }
    };
    found.iter().map(finding).collect()
}

impl Misread {
    /// What is wrong with one column of a joint.
    fn of_joint(joint: Joint, text: String, quantity: Quantity, to: To) -> Self {
        Self {
            joint: Some(joint),
            text,
            changes: vec![Change::of(joint, quantity, to)],
        }
    }
}

impl Change {
    fn of(joint: Joint, quantity: Quantity, to: To) -> Self {
        let joint = Some(joint);
        Self {
            quantity,
            joint,
            to,
        }
    }

    /// Its place among the columns of its quantity.
    fn place(&self) -> usize {
        self.joint.map_or(0, Joint::index)
    }

    /// Applies the change to the log.
    fn apply(&self, log: &mut Log) {
        if matches!(self.to, To::Derived) {
            log.qd = log.q.iter().map(|q| slopes(&log.time, q)).collect();
            log.is_qd_derived = true;
            return;
        }
        let values = &mut log.of_mut(self.quantity)[self.place()];
        let factor = match self.to {
            To::Unit(unit) => self.quantity.size_of(unit).unwrap_or(1.0),
            To::Opposite => -1.0,
            To::Wrapped | To::Derived => {
                unwrap(values, std::f64::consts::TAU);
                1.0
            }
        };
        values.iter_mut().for_each(|value| *value *= factor);
    }

    /// Applies the change to the columns of the model file.
    fn mend(&self, columns: &mut Columns) {
        if matches!(self.to, To::Derived) {
            columns.qd = None;
        }
        // Velocities that come from the angles have no columns.
        let Some(column) = columns.of_mut(self.quantity).get_mut(self.place()) else {
            return;
        };
        match self.to {
            To::Unit(unit) if column.unit.is_none() => column.unit = Some(unit),
            To::Unit(unit) => column.factor *= self.quantity.size_of(unit).unwrap_or(1.0),
            To::Opposite => column.factor = -column.factor,
            To::Wrapped => column.wrapped = true,
            To::Derived => {}
        }
    }
}
