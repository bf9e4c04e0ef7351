//! A rig of many joints at a glance: one table of joints by effects, like joints side by side, and where these differ.

mod difference;
mod errors;
mod own_values;

use residyn_core::data::Joint;

use super::schema::{EffectEntry, ParameterEntry, Report};

pub(super) use difference::{DifferenceEntry, differences};
pub(super) use errors::{JointErrors, sentence};
pub(super) use own_values::{OfJointEntry, OwnValues, declared, found, of_joints};

/// Up to this many joints, a card for each effect and a row for each joint fit a screen and a terminal, and the reader wants
/// them all: an arm has seven. Rigs with more have limbs that repeat each other: what matters is what they share and where they
/// differ, which only a table shows.
const FEW: usize = 7;

/// Whether a rig of so many joints is shown as a table of joints by effects, with the details of each joint behind it.
pub(super) const fn is_large(joints: usize) -> bool {
    joints > FEW
}

/// Rows are joints, columns are effects and constants of drives.
pub(super) struct Overview<'r> {
    pub columns: Vec<Column<'r>>,
    pub rows: Vec<Row<'r>>,
}

pub(super) struct Column<'r> {
    /// The name of an effect, or of a constant of the drives.
    pub of: &'r str,
    /// The parameter that is shown, and its unit.
    pub symbol: String,
    pub unit: &'r str,
    /// Whether there are more parameters than that.
    pub has_more: bool,
}

pub(super) struct Row<'r> {
    pub joint: Joint,
    /// Whether the joint before it is of another role.
    pub begins_group: bool,
    /// One per column.
    pub cells: Vec<Option<Held<'r>>>,
}

/// What a joint holds of a column.
pub(super) struct Held<'r> {
    pub standing: Standing,
    pub parameters: Vec<&'r ParameterEntry>,
    /// How the value that is shown differs from that of like joints, if it does.
    pub side: Option<Side>,
}

impl<'r> Held<'r> {
    /// The parameter that a table shows: the first that was fitted.
    pub fn shown(&self) -> &'r ParameterEntry {
        shown(&self.parameters)
    }
}

/// How much a value can be relied on.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Standing {
    Established,
    Supported,
    /// Of the model file, refitted.
    Declared,
}

#[derive(Clone, Copy)]
pub(super) enum Side {
    Above,
    Below,
}

impl Side {
    pub const fn mark(self) -> char {
        match self {
            Self::Above => '▲',
            Self::Below => '▼',
        }
    }
}

/// An effect on its joints, or a constant of a joint's drive.
struct Item<'r> {
    of: &'r str,
    joints: Vec<Joint>,
    standing: Standing,
    parameters: &'r [ParameterEntry],
}

impl<'r> Overview<'r> {
    pub fn of(report: &'r Report) -> Self {
        let items = items(report);
        let mut names: Vec<&str> = Vec::new();
        for item in &items {
            if !names.contains(&item.of) {
                names.push(item.of);
            }
        }
        let differs = |of: &str| report.differences.iter().any(|one| one.of == of);
        let joints = |of: &str| items.iter().filter(|item| item.of == of).count();
        // What differs stands first, then what most joints have.
        names.sort_by_key(|of| (!differs(of), std::cmp::Reverse(joints(of))));
        let columns: Vec<Column<'_>> = names.iter().map(|of| column(&items, of)).collect();
        let row = |(joint, begins_group): (Joint, bool)| Row {
            joint,
            begins_group,
            cells: (columns.iter())
                .map(|column| held(report, &items, column, joint))
                .collect(),
        };
        let rows = in_order(report.joints, &report.like_joints).into_iter();
        Self {
            rows: rows.map(row).collect(),
            columns,
        }
    }
}

fn items(report: &Report) -> Vec<Item<'_>> {
    let found = [
        (Standing::Established, &report.effects),
        (Standing::Supported, &report.supported),
    ];
    let found = found.into_iter().flat_map(|(standing, effects)| {
        effects.iter().map(move |effect| Item {
            of: effect.name.as_str(),
            joints: effect.on(),
            standing,
            parameters: &effect.parameters,
        })
    });
    let declared = report.of_joints.iter().map(|own| Item {
        of: own.of.as_str(),
        joints: vec![own.joint],
        standing: Standing::Declared,
        parameters: &own.parameters,
    });
    let items = found.chain(declared);
    items.filter(|item| !item.parameters.is_empty()).collect()
}

fn column<'r>(items: &[Item<'r>], of: &'r str) -> Column<'r> {
    let own: Vec<&Item<'_>> = items.iter().filter(|item| item.of == of).collect();
    let first: Vec<&ParameterEntry> = own[0].parameters.iter().collect();
    let shown = shown(&first);
    let fitted = |item: &&Item<'_>| {
        let fitted = item.parameters.iter().filter(|p| p.ci95.is_some());
        fitted.count() > 1
    };
    Column {
        of,
        symbol: stem(&shown.name, of, own[0].joints[0]),
        unit: &shown.unit,
        has_more: own.iter().any(fitted),
    }
}

fn held<'r>(
    report: &Report,
    items: &[Item<'r>],
    column: &Column<'_>,
    joint: Joint,
) -> Option<Held<'r>> {
    let is_own = |item: &&Item<'_>| item.of == column.of && item.joints.contains(&joint);
    let own: Vec<&Item<'_>> = items.iter().filter(is_own).collect();
    let differs = report.differences.iter().find(|one| {
        one.of == column.of && one.parameter == column.symbol && one.joints.contains(&joint)
    });
    Some(Held {
        standing: own.iter().map(|item| item.standing).min()?,
        parameters: own.iter().flat_map(|item| item.parameters).collect(),
        side: differs.map(DifferenceEntry::side),
    })
}

fn shown<'r>(parameters: &[&'r ParameterEntry]) -> &'r ParameterEntry {
    let mut fitted = parameters.iter().filter(|p| p.ci95.is_some());
    fitted.next().unwrap_or(&parameters[0])
}

impl EffectEntry {
    /// The joints that it acts on.
    pub fn on(&self) -> Vec<Joint> {
        self.joints.clone().unwrap_or_else(|| vec![self.joint])
    }
}

/// A parameter's name without its joint's number, and without the effect that it is distinguished by: `F_c` of `F_c12`, `kp` of
/// `kp_12`.
fn stem(name: &str, of: &str, joint: Joint) -> String {
    let name = name.strip_suffix(&joint.to_string()).unwrap_or(name);
    let name = name.trim_end_matches('_');
    let own = name.strip_prefix(of).and_then(|own| own.strip_prefix('_'));
    own.unwrap_or(name).to_owned()
}

/// All joints, like ones side by side, each with whether a group of its own begins with it.
pub(super) fn in_order(joints: usize, like: &[Vec<Joint>]) -> Vec<(Joint, bool)> {
    let group = |joint: &Joint| like.iter().find(|group| group.contains(joint));
    let mut ordered: Vec<(Joint, bool)> = Vec::new();
    let mut was_alone = true;
    for joint in Joint::all(joints) {
        match group(&joint) {
            Some(group) if group[0] == joint => {
                ordered.extend(group.iter().map(|own| (*own, *own == joint)));
                was_alone = false;
            }
            Some(_) => {}
            None => {
                ordered.push((joint, !was_alone));
                was_alone = true;
            }
        }
    }
    ordered
}

impl Report {
    /// A joint in few letters: its name, without the word that ends all of them.
    pub(super) fn short_name(&self, joint: Joint) -> &str {
        const END: &str = "_joint";
        let name = self.joint_names[joint.index()].as_str();
        match self.joint_names.iter().all(|name| name.ends_with(END)) {
            true => &name[..name.len() - END.len()],
            false => name,
        }
    }

    pub(super) fn short_names(&self, joints: &[Joint]) -> Vec<String> {
        let names = joints.iter().map(|joint| self.short_name(*joint));
        names.map(str::to_owned).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{in_order, stem};
    use residyn_core::data::Joint;

    #[test]
    fn like_joints_stand_side_by_side() {
        let like = [
            vec![Joint::at(0), Joint::at(2)],
            vec![Joint::at(1), Joint::at(4)],
        ];
        let ordered = in_order(6, &like).into_iter();
        let ordered: Vec<(usize, bool)> = ordered
            .map(|(joint, begins)| (joint.number(), begins))
            .collect();
        let expected = [
            (1, true),
            (3, false),
            (2, true),
            (5, false),
            (4, true),
            (6, false),
        ];
        assert_eq!(ordered, expected);
    }

    #[test]
    fn numbers_of_joints_are_no_part_of_symbols() {
        let joint = Joint::at(11);
        for (of, name, bare) in [
            ("coulomb_friction", "F_c12", "F_c"),
            ("coulomb_friction", "coulomb_friction_F_c12", "F_c"),
            ("constant_torque", "tau_012", "tau_0"),
            ("kp", "kp_12", "kp"),
            ("", "kp_12", "kp"),
            ("", "stiffness", "stiffness"),
        ] {
            assert_eq!(stem(name, of, joint), bare);
        }
    }
}
