//! The mapping from columns of a file to channels.

use std::path::Path;

use super::column::{Column, Quantity};
use super::error::{LogError, Place};
use super::joint::{Joint, of_joints};
use super::measured::is_measured;
use super::named_columns;
use super::torque_column::TorqueColumn;
use crate::expr::listed;

/// Columns in which a log file holds time, angles, velocities and torques, and their units.
///
/// This is the `[columns]` table of a model file. An empty list stands for the standard names
/// (`q1..`, `qd1..`, `tau1..` or `cmd1..`) in standard units, so that a model file has to name only what differs.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    pub time: Column,
    /// Joint angles, joint 1 first.
    pub q: Vec<Column>,
    /// Joint velocities, joint 1 first; `None` if they are to come from the angles.
    pub qd: Option<Vec<Column>>,
    /// Joint torques or commands of the drives, joint 1 first.
    pub tau: Vec<Column>,
    /// Which of the two they are: [`Quantity::Torque`] or [`Quantity::Command`].
    pub driven_by: Quantity,
    /// Further measured columns that formulas of the model may use.
    pub measured: Vec<MeasuredColumn>,
    /// What the torques are, if it is known.
    pub torque: Option<TorqueColumn>,
    /// The topic of a recording that has the joints; `None` if their names determine it.
    pub topic: Option<String>,
    /// Names of the joints, if they have any. A standard column that a header lacks may go by the name of its joint:
    /// `q_elbow`, `elbow_pos` or `position/elbow` for `q2`.
    pub joint_names: Vec<String>,
    /// Whether each joint slides: its columns are then in m, m/s and N. Where it is shorter than the joints, they turn.
    pub slides: Vec<bool>,
}

/// A measured column beside those of the joints.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredColumn {
    /// As formulas call it: `u_volts`.
    pub name: String,
    /// Where it stands in the log.
    pub column: Column,
}

impl Default for Columns {
    /// `time`, and the standard names for however many joints the model has.
    fn default() -> Self {
        Self {
            time: Column::named("time"),
            q: vec![],
            qd: Some(vec![]),
            tau: vec![],
            driven_by: Quantity::Torque,
            measured: vec![],
            torque: None,
            topic: None,
            joint_names: vec![],
            slides: vec![],
        }
    }
}

impl Columns {
    /// The standard columns `time`, `q1..`, `qd1..`, and `tau1..` or `cmd1..`, for a number of joints.
    pub fn standard(joints: usize, driven_by: Quantity) -> Self {
        Self {
            q: numbered("q", joints),
            qd: Some(numbered("qd", joints)),
            tau: numbered(driven_by.key(), joints),
            driven_by,
            ..Self::default()
        }
    }

    /// The columns of these joints alone.
    #[must_use]
    pub(crate) fn of_joints(&self, joints: &[Joint]) -> Self {
        Self {
            q: of_joints(&self.q, joints),
            qd: self.qd.as_ref().map(|qd| of_joints(qd, joints)),
            tau: of_joints(&self.tau, joints),
            joint_names: of_joints(&self.joint_names, joints),
            slides: of_joints(&self.slides, joints),
            ..self.clone()
        }
    }

    /// The unit of a joint's angle or length, velocity, or torque or force; none for a command, nor for what is not a
    /// joint's.
    pub fn unit(&self, quantity: Quantity, joint: Joint) -> &'static str {
        let slides = self.slides.get(joint.index()).copied().unwrap_or(false);
        let [of_turning, of_sliding] = match quantity {
            Quantity::Time => ["s", "s"],
            Quantity::Angle => ["rad", "m"],
            Quantity::Velocity => ["rad/s", "m/s"],
            Quantity::Torque => ["N m", "N"],
            Quantity::Command | Quantity::Measured => ["", ""],
        };
        if slides { of_sliding } else { of_turning }
    }

    /// The columns of a quantity, one for each joint except for the time; measured columns are of no joint.
    fn of(&self, quantity: Quantity) -> &[Column] {
        match quantity {
            Quantity::Time => std::slice::from_ref(&self.time),
            Quantity::Angle => &self.q,
            Quantity::Velocity => self.qd.as_deref().unwrap_or_default(),
            Quantity::Torque | Quantity::Command => &self.tau,
            Quantity::Measured => &[],
        }
    }

    pub(super) fn of_mut(&mut self, quantity: Quantity) -> &mut [Column] {
        match quantity {
            Quantity::Time => std::slice::from_mut(&mut self.time),
            Quantity::Angle => &mut self.q,
            Quantity::Velocity => self.qd.as_deref_mut().unwrap_or_default(),
            Quantity::Torque | Quantity::Command => &mut self.tau,
            Quantity::Measured => &mut [],
        }
    }

    /// All columns: time, angles, velocities, torques, further measured ones.
    pub(crate) fn in_file_order(&self) -> impl Iterator<Item = &Column> {
        let quantities = [Quantity::Time, Quantity::Angle, Quantity::Velocity];
        let all = quantities.into_iter().chain([self.driven_by]);
        let measured = self.measured.iter().map(|measured| &measured.column);
        all.flat_map(move |quantity| self.of(quantity))
            .chain(measured)
    }

    /// The line of a model file under `[columns]` for one of the quantities: `tau = [{ column = "tau1", factor = -1 }]`.
    pub fn line(&self, quantity: Quantity) -> String {
        let columns: Vec<String> = self.of(quantity).iter().map(Column::to_string).collect();
        let (key, columns) = (quantity.key(), columns.join(", "));
        match quantity {
            Quantity::Time => format!("{key} = {columns}"),
            _ => format!("{key} = [{columns}]"),
        }
    }

    /// These columns with every empty list filled with the standard names; `None` if a list has another length.
    pub(super) fn whole(&self, joints: usize) -> Option<Columns> {
        self.completed(joints, Path::new("")).ok()
    }

    /// These columns with every empty list filled with the standard names.
    ///
    /// # Errors
    /// A list of another length.
    pub fn completed(&self, joints: usize, path: &Path) -> Result<Columns, LogError> {
        let list = |list: &'static str, columns: &Vec<Column>| match columns.len() {
            0 => Ok(numbered(list, joints)),
            named if named == joints => Ok(columns.clone()),
            named => Err(LogError::Mapping {
                path: path.to_owned(),
                list,
                named,
                joints,
            }),
        };
        Ok(Columns {
            q: list("q", &self.q)?,
            qd: self.qd.as_ref().map(|qd| list("qd", qd)).transpose()?,
            tau: list(self.driven_by.key(), &self.tau)?,
            ..self.clone()
        })
    }

    /// Whether one of these columns has this name.
    pub fn names(&self, name: &str) -> bool {
        self.in_file_order().any(|column| column.name == name)
    }

    /// Whether a header has the angles of all joints.
    pub fn has_angles_in(&self, header: &[String]) -> bool {
        let renamed = self.clone().renamed_for(header);
        renamed.q.iter().all(|column| header.contains(&column.name))
    }

    /// These columns, with each standard name that the header lacks replaced by the one with the joint's name, if the
    /// header has that. A single joint may be the header's only named one, or have no name: `q` for `q1`.
    fn renamed_for(mut self, header: &[String]) -> Columns {
        let single = self.q.len() == 1;
        let mut names = self.joint_names.clone();
        if let (true, [], [joint]) = (single, &*names, &*joints(header)) {
            names = vec![(*joint).to_owned()];
        }
        let has = |name: &String| header.contains(name);
        for quantity in [Quantity::Angle, Quantity::Velocity, self.driven_by] {
            let stem = quantity.key();
            for (joint, column) in self.of_mut(quantity).iter_mut().enumerate() {
                if column.name != format!("{stem}{}", joint + 1) || has(&column.name) {
                    continue;
                }
                let by_joint = names.get(joint).map(|name| format!("{stem}_{name}"));
                let alone = single.then(|| stem.to_owned());
                let plain = by_joint.into_iter().chain(alone).find(has);
                let by_words = || named_columns::find(header, names.get(joint)?, quantity).cloned();
                if let Some(name) = plain.or_else(by_words) {
                    column.name = name;
                }
            }
        }
        self
    }
}

/// The joints after which a header names its angles. The four parts of a quaternion are none.
pub(super) fn joints(header: &[String]) -> Vec<&str> {
    let joints = header.iter().filter_map(|name| name.strip_prefix("q_"));
    let joints: Vec<&str> = joints.collect();
    let is_quaternion = QUATERNION.iter().all(|part| joints.contains(part));
    let is_joint = |name: &&str| !is_quaternion || !QUATERNION.contains(name);
    joints.into_iter().filter(is_joint).collect()
}

const QUATERNION: [&str; 4] = ["w", "x", "y", "z"];

fn numbered(prefix: &str, joints: usize) -> Vec<Column> {
    let name = |joint: Joint| Column::named(joint.name(prefix));
    Joint::all(joints).map(name).collect()
}

/// Where one column of a channel stands in a row, and how its numbers are converted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    pub index: usize,
    pub scale: f64,
    pub wrapped: bool,
    pub late_s: f64,
}

/// Words in the names of columns that hold torques or commands, and of columns that hold velocities.
const LIKE_DRIVEN: &[&str] = &["tau", "torque", "effort", "cmd", "command"];
const LIKE_VELOCITY: &[&str] = &["qd", "dq", "vel", "speed", "omega", "rpm", "dot"];

/// The header of a file, and its line.
pub(super) struct Header<'a> {
    pub path: &'a Path,
    pub place: Place,
    pub names: Vec<String>,
}

/// Where the channels stand in a row.
#[derive(Debug, PartialEq)]
pub(super) struct Layout {
    pub time: Cell,
    pub q: Vec<Cell>,
    /// `None` if velocities come from the angles.
    pub qd: Option<Vec<Cell>>,
    /// `None` for the log of a passive rig, which has no torque columns, and for a joint without a drive.
    pub tau: Option<Vec<Option<Cell>>>,
    /// The further measured columns that the model needs, in its order, then those that it does not mention.
    pub measured: Vec<MeasuredCell>,
    /// Names of the columns that nothing reads.
    pub ignored: Vec<String>,
}

/// Where a further measured column stands in a row.
#[derive(Debug, PartialEq)]
pub(super) struct MeasuredCell {
    pub name: String,
    pub cell: Cell,
    pub is_needed: bool,
}

impl Layout {
    /// The channels: angles, velocities, torques, further measured columns.
    fn channels(&self) -> impl Iterator<Item = &Cell> {
        let tau = self.tau.iter().flatten().flatten();
        let measured = self.measured.iter().map(|measured| &measured.cell);
        let of_joints = self.q.iter().chain(self.qd.iter().flatten()).chain(tau);
        of_joints.chain(measured)
    }

    /// Time and all channels.
    pub fn cells(&self) -> impl Iterator<Item = &Cell> {
        std::iter::once(&self.time).chain(self.channels())
    }

    /// How late each channel is, s.
    pub fn late_s(&self) -> impl Iterator<Item = f64> {
        self.channels().map(|cell| cell.late_s)
    }
}

impl Header<'_> {
    /// Finds the columns of a model with `joints` joints.
    pub fn layout(&self, joints: usize, columns: &Columns) -> Result<Layout, LogError> {
        let columns = columns.completed(joints, self.path)?;
        self.check_is_a_header(&columns)?;
        let Columns {
            time, q, qd, tau, ..
        } = Columns::standard(joints, columns.driven_by);
        let standard = Columns {
            time,
            q,
            qd,
            tau,
            ..columns.clone()
        };
        if columns == standard {
            self.check_joint_count(joints)?;
        }
        let is_torque = columns.driven_by == Quantity::Torque;
        let passive =
            is_torque && columns.tau == standard.tau && !self.has_one_like(LIKE_DRIVEN, |_| false);
        let is_beside = |name: &str| named_columns::is_beside(name, &columns.joint_names);
        let still = columns.qd == standard.qd && !self.has_one_like(LIKE_VELOCITY, is_beside);
        let columns = columns.renamed_for(&self.names);
        let all = |list: &[Column], quantity| {
            let find = |column: &Column| self.find(column, quantity, &columns);
            list.iter().map(find).collect::<Result<Vec<_>, _>>()
        };
        let driven = |list: &[Column]| {
            let driven = list.iter().map(|column| {
                let named = Some(column).filter(|column| !column.is_none());
                named.map(|column| self.find(column, columns.driven_by, &columns))
            });
            driven.map(Option::transpose).collect::<Result<Vec<_>, _>>()
        };
        let qd = columns.qd.as_deref().filter(|_| !still);
        let tau = Some(&columns.tau).filter(|_| !passive);
        let others = self.others(&columns);
        let is_single = |name: &String| self.names.iter().filter(|own| *own == name).count() == 1;
        let is_probe = |name: &String| is_measured(name) && is_single(name);
        let (probes, ignored) = others.into_iter().partition(is_probe);
        Ok(Layout {
            time: self.find(&columns.time, Quantity::Time, &columns)?,
            q: all(&columns.q, Quantity::Angle)?,
            qd: qd.map(|qd| all(qd, Quantity::Velocity)).transpose()?,
            tau: tau.map(|tau| driven(tau)).transpose()?,
            measured: self.measured(&columns, probes)?,
            ignored,
        })
    }

    /// The measured columns of the model, then these, which it does not mention.
    fn measured(
        &self,
        columns: &Columns,
        probes: Vec<String>,
    ) -> Result<Vec<MeasuredCell>, LogError> {
        let cell = |name: &str, column: &Column, is_needed: bool| {
            Ok(MeasuredCell {
                name: name.to_owned(),
                cell: self.find(column, Quantity::Measured, columns)?,
                is_needed,
            })
        };
        let needed = columns.measured.iter();
        let needed = needed.map(|MeasuredColumn { name, column }| cell(name, column, true));
        let known = |name: &String| columns.measured.iter().any(|own| own.name == *name);
        let probes = probes.into_iter().filter(|name| !known(name));
        let probes = probes.map(|name| cell(&name, &Column::named(name.as_str()), false));
        needed.chain(probes).collect()
    }

    /// Numbers for names, unless the columns are numbers as well.
    fn check_is_a_header(&self, columns: &Columns) -> Result<(), LogError> {
        let (path, place) = (self.path.to_owned(), self.place);
        let is_numbered = |column: &Column| column.is_none() || is_whole(&column.name);
        if self.has_numbers() && !columns.in_file_order().all(is_numbered) {
            return Err(LogError::NoHeader { path, place });
        }
        Ok(())
    }

    /// Whether all names are numbers: those of the columns of a table without a header.
    fn has_numbers(&self) -> bool {
        self.names.iter().all(|name| name.parse::<f64>().is_ok())
    }

    /// A header with another number of complete joints most likely belongs to the log of another rig. If only one of a
    /// joint's columns is missing, a wrong name is more likely, which `find` reports.
    fn check_joint_count(&self, joints: usize) -> Result<(), LogError> {
        let has = |name: String| self.names.contains(&name);
        let header = (1..).take_while(|joint| has(format!("q{joint}"))).count();
        let next = header + 1;
        let driven = [Quantity::Torque, Quantity::Command].map(|q| format!("{}{next}", q.key()));
        let next_is_absent = !has(format!("qd{next}")) && !driven.into_iter().any(has);
        if header > joints || (0 < header && header < joints && next_is_absent) {
            return Err(LogError::JointCount {
                path: self.path.to_owned(),
                place: self.place,
                header,
                model: joints,
            });
        }
        Ok(())
    }

    /// Whether the name of some column, but those of something else, contains one of these words. A torque or a velocity
    /// under an unexpected name must not be passed over silently.
    fn has_one_like(&self, words: &[&str], is_else: impl Fn(&str) -> bool) -> bool {
        let is_like = |name: &String| {
            let name = name.to_lowercase();
            words.iter().any(|word| name.contains(word))
        };
        // `q_level` is the angle of a joint, whatever its name, and `u_fan_speed` is no joint's velocity.
        let is_known = |name: &String| name.starts_with("q_") || is_measured(name);
        let others = self.names.iter().filter(|name| !is_known(name));
        let mut others = others.filter(|name| !is_else(name));
        others.any(is_like)
    }

    fn find(
        &self,
        wanted: &Column,
        quantity: Quantity,
        columns: &Columns,
    ) -> Result<Cell, LogError> {
        let name = &wanted.name;
        let mut places = (0..self.names.len()).filter(|&index| self.names[index] == *name);
        let (path, place, column) = (self.path.to_owned(), self.place, name.clone());
        match (places.next(), places.next()) {
            (Some(index), None) => Ok(Cell {
                index,
                scale: wanted.scale(quantity),
                wrapped: wanted.wrapped,
                late_s: wanted.late_s,
            }),
            (Some(_), Some(_)) => Err(LogError::DuplicateColumn {
                path,
                place,
                column,
            }),
            (None, _) => Err(LogError::MissingColumn {
                path,
                place,
                column,
                remedy: self.remedy(name, quantity, &self.others(columns)),
            }),
        }
    }

    /// Points to the nearest of the `free` names (those of no other channel) if one is near, and to all names
    /// otherwise.
    fn remedy(&self, wanted: &str, quantity: Quantity, free: &[String]) -> String {
        if self.has_numbers() {
            let columns = self.names.len();
            return format!(
                "the file has no header, and {columns} columns: under [columns] in the model file, give a number from 1 \
                 to {columns}"
            );
        }
        if is_whole(wanted) {
            let names = listed(self.names.iter().map(String::as_str));
            return format!(
                "columns go by their numbers only in a file without a header; name one of {names} under [columns] in the \
                 model file"
            );
        }
        let joints = joints(&self.names);
        if !joints.is_empty() && quantity == Quantity::Angle {
            return format!(
                "the log has the joints {}: give the model's joints these names, joint_names = [\"{}\", ..] under \
                 [system] in the model file, or name the columns under [columns]: q = [\"q_{}\", ..]",
                listed(joints.iter().copied()),
                joints[0],
                joints[0]
            );
        }
        let scored = free.iter().map(|name| (likeness(name, wanted), name));
        let nearest = scored.max_by(|a, b| a.0.total_cmp(&b.0));
        let nearest = nearest.filter(|(likeness, _)| *likeness >= 0.5);
        let nearest = nearest.map(|(_, name)| name);
        let example = nearest.map_or("NAME", String::as_str);
        let entry = match quantity {
            Quantity::Time => format!("time = {example:?}"),
            Quantity::Velocity => {
                format!("qd = [{example:?}], or qd = [] to take velocities from the angles")
            }
            Quantity::Torque if self.names.iter().any(|name| is_command(name)) => {
                return "the log has commands, cmd1: say in [drive] of the model file which torque they produce, for \
                        instance tau1 = \"kp*(cmd1 - q1) - kd*qd1\"; `residyn list drives` shows ready-made drives"
                    .to_owned();
            }
            Quantity::Torque | Quantity::Command => {
                let key = quantity.key();
                format!("{key} = [{example:?}], with \"\" for a joint without a drive")
            }
            Quantity::Angle => format!("q = [{example:?}]"),
            Quantity::Measured => format!("{wanted} = {example:?}"),
        };
        let known = match nearest {
            Some(name) => format!("did you mean {name:?}?"),
            None => {
                let names = listed(self.names.iter().map(String::as_str));
                format!("the header has {names}.")
            }
        };
        format!("{known} Rename it, or name it under [columns] in the model file: {entry}")
    }

    fn others(&self, columns: &Columns) -> Vec<String> {
        let used = |name: &&String| columns.in_file_order().any(|wanted| wanted.name == **name);
        let unused = self.names.iter().filter(|name| !used(name));
        unused.cloned().collect()
    }
}

fn is_whole(name: &str) -> bool {
    name.parse::<usize>().is_ok()
}

fn is_command(name: &str) -> bool {
    name == "cmd1" || name.starts_with("cmd_")
}

/// 1 for the same name up to case, 0 for nothing in common; a swap of neighbours (`dq1` for `qd1`) counts as one
/// change.
fn likeness(a: &str, b: &str) -> f64 {
    strsim::normalized_damerau_levenshtein(&a.to_lowercase(), &b.to_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(header: &str, joints: usize, columns: &Columns) -> Result<Layout, LogError> {
        let header = Header {
            path: Path::new("rig.csv"),
            place: Place::Line(1),
            names: header.split(',').map(str::to_owned).collect(),
        };
        header.layout(joints, columns)
    }

    fn cell(index: usize) -> Cell {
        let (scale, wrapped, late_s) = (1.0, false, 0.0);
        Cell {
            index,
            scale,
            wrapped,
            late_s,
        }
    }

    fn message(header: &str, joints: usize) -> String {
        layout(header, joints, &Columns::default())
            .unwrap_err()
            .to_string()
    }

    /// The places of the channels, each with the standard unit.
    fn places(header: &str, joints: usize, columns: &Columns) -> [Option<Vec<usize>>; 3] {
        let found = layout(header, joints, columns).unwrap();
        let tau = found.tau.map(|tau| tau.into_iter().flatten().collect());
        let places = |cells: Vec<Cell>| {
            let as_is = cells.iter().all(|found| *found == cell(found.index));
            assert!(as_is, "{cells:?}");
            cells.iter().map(|cell| cell.index).collect()
        };
        [Some(found.q), found.qd, tau].map(|cells| cells.map(places))
    }

    #[test]
    fn order_is_free_and_extra_columns_are_named() {
        let found = layout("tau1,note,qd1,q1,time", 1, &Columns::default()).unwrap();
        let expected = Layout {
            time: cell(4),
            q: vec![cell(3)],
            qd: Some(vec![cell(2)]),
            tau: Some(vec![Some(cell(0))]),
            measured: Vec::new(),
            ignored: vec!["note".to_owned()],
        };
        assert_eq!(found, expected);
    }

    #[test]
    fn a_header_that_does_not_fit_says_why_and_what_to_do() {
        let cases = [
            (
                "time,q1,dq1,tau1",
                1,
                "rig.csv, line 1: there is no column \"qd1\"; did you mean \"dq1\"? Rename it, or name it under \
                 [columns] in the model file: qd = [\"dq1\"], or qd = [] to take velocities from the angles",
            ),
            ("Time,q1,qd1,tau1", 1, "in the model file: time = \"Time\""),
            ("time,angle,qd1", 1, "the header has time, angle, qd1."),
            (
                "time,q1,q2,qd1,qd2,tau1,tau2",
                1,
                "has 2 joint(s) (q1 to q2) but the model has 1",
            ),
            (
                "time,q1,qd1,tau1",
                2,
                "has 1 joint(s) (q1 to q1) but the model has 2",
            ),
            ("time,q1,Q2,qd1,qd2,tau1,tau2", 2, "did you mean \"Q2\"?"),
            ("time,q,qd,tau", 2, "there is no column \"q1\""),
            ("time,q_hip,q_knee", 1, "joint_names = [\"hip\", ..]"),
            // A torque or a velocity under another name is not passed over.
            ("time,q1,qd1,torque_1", 1, "there is no column \"tau1\""),
            ("time,q1,q2,qd1,qd2,tau1", 2, "there is no column \"tau2\""),
            ("time,q1,velocity_1,tau1", 1, "there is no column \"qd1\""),
            (
                "time,q1,q1,qd1,tau1",
                1,
                "column \"q1\" occurs more than once",
            ),
            ("0,1,2,3", 1, "has numbers where the header should be"),
        ];
        for (header, joints, words) in cases {
            let message = message(header, joints);
            assert!(message.contains(words), "{message}");
        }
        let columns = Columns {
            tau: vec!["a".into(), "b".into()],
            ..Columns::default()
        };
        let error = layout("time,q1,qd1,a,b", 1, &columns)
            .unwrap_err()
            .to_string();
        assert!(error.contains("names 2 column(s) for `tau`"), "{error}");
    }

    #[test]
    fn columns_without_a_header_go_by_their_numbers() {
        let columns = Columns {
            time: "1".into(),
            q: vec!["3".into()],
            qd: None,
            tau: vec!["2".into()],
            ..Columns::default()
        };
        let found = places("1,2,3,4", 1, &columns);
        assert_eq!(found, [Some(vec![2]), None, Some(vec![1])]);
        let few = layout("1,2", 1, &columns).unwrap_err().to_string();
        assert!(few.contains("give a number from 1 to 2"), "{few}");
        let named = layout("time,q1,tau1", 1, &columns).unwrap_err().to_string();
        assert!(named.contains("only in a file without a header"), "{named}");
        // A torque is not passed over because columns have no names.
        let unsaid = Columns {
            tau: vec![],
            ..columns
        };
        let message = layout("1,2,3,4", 1, &unsaid).unwrap_err().to_string();
        assert!(message.contains("time = 1, q = [2]"), "{message}");
    }

    #[test]
    fn a_joint_without_a_drive_needs_no_column() {
        let columns = Columns {
            tau: vec!["motor".into(), "".into()],
            ..Columns::default()
        };
        let found = layout("time,q1,q2,qd1,qd2,motor", 2, &columns).unwrap();
        assert_eq!(found.tau, Some(vec![Some(cell(5)), None]));
    }

    #[test]
    fn a_mapping_chooses_one_joint_of_many() {
        let columns = Columns {
            q: vec!["q2".into()],
            qd: Some(vec!["qd2".into()]),
            tau: vec!["tau2".into()],
            ..Columns::default()
        };
        let found = places("time,q1,q2,qd1,qd2,tau1,tau2", 1, &columns);
        assert_eq!(found, [2, 4, 6].map(|place| Some(vec![place])));
    }

    #[test]
    fn columns_may_have_the_names_of_the_joints() {
        let columns = Columns {
            joint_names: vec!["base".into(), "elbow".into()],
            ..Columns::default()
        };
        let header = "time,q_elbow,q_base,qd1,qd2,tau_base,tau_elbow";
        let found = places(header, 2, &columns);
        assert_eq!(
            found,
            [[2, 1], [3, 4], [5, 6]].map(|two| Some(two.to_vec()))
        );
        for header in ["time,q,qd,tau", "time,q_hip,qd_hip,tau_hip"] {
            let found = places(header, 1, &Columns::default());
            assert_eq!(found, [1, 2, 3].map(|place| Some(vec![place])));
        }
    }

    #[test]
    fn columns_of_named_joints_stand_in_any_order_and_under_many_names() {
        let columns = Columns {
            joint_names: ["FL_hip_joint", "FL_calf_joint"]
                .map(str::to_owned)
                .to_vec(),
            ..Columns::default()
        };
        let header = "position/FL_calf,FL_hip_pos,time,vel_FL_calf,FL_hip_vel,FL_calf_effort,torque_FL_hip,FL_hip_temp";
        let found = places(header, 2, &columns);
        assert_eq!(
            found,
            [[1, 0], [4, 3], [6, 5]].map(|two| Some(two.to_vec()))
        );
    }

    #[test]
    fn what_the_base_does_and_should_do_is_ignored_by_name() {
        let beside =
            "base_pos_x,q_w,q_x,q_y,q_z,imu_angular_velocity_x,base_lin_vel_z,des_dof_vel1";
        let found = layout(&format!("time,q1,tau1,{beside}"), 1, &Columns::default()).unwrap();
        assert_eq!(
            (found.qd, found.ignored.join(",")),
            (None, beside.to_owned())
        );
        let header: Vec<String> = ["q_w", "q_x", "q_hip", "q_y", "q_z"]
            .map(str::to_owned)
            .to_vec();
        assert_eq!(joints(&header), ["hip"]);
        assert_eq!(joints(&header[1..]), ["x", "hip", "y", "z"]);
    }

    #[test]
    fn only_a_header_without_any_torque_or_velocity_does_without() {
        let [first, second] = [1, 2].map(|place| Some(vec![place]));
        let places = |header| places(header, 1, &Columns::default());
        let passive = [first.clone(), second.clone(), None];
        assert_eq!(places("time,q1,qd1"), passive);
        assert_eq!(places("time,q1,tau1"), [first, None, second]);
        let from_angles = Columns {
            qd: None,
            ..Columns::default()
        };
        let found = layout("time,q1,qd1,tau1", 1, &from_angles).unwrap();
        assert_eq!((found.qd, found.ignored), (None, vec!["qd1".to_owned()]));
    }
}
