//! Columns that are named by a joint and a quantity, as loggers name them: `FL_hip_pos`, `position/FL_hip`,
//! `target_FL_hip_joint`.

use super::column::Quantity;

/// Words of which one says what a column holds.
fn words(quantity: Quantity) -> &'static [&'static str] {
    match quantity {
        Quantity::Time | Quantity::Measured => &[],
        Quantity::Angle => &["q", "pos", "position", "angle"],
        Quantity::Velocity => &["qd", "dq", "vel", "velocity", "speed"],
        Quantity::Torque => &["tau", "torque", "effort"],
        Quantity::Command => TARGETS,
    }
}

const TARGETS: &[&str] = &[
    "cmd",
    "command",
    "target",
    "des",
    "desired",
    "ref",
    "reference",
    "goal",
    "setpoint",
];

/// Words that say no more.
const FILLERS: &[&str] = &["joint", "dof", "actual", "measured", "state"];

/// Words of columns about the base of a robot, its feet, or what sensors on it measure: no joint's, whatever they end in.
const BESIDE: &[&str] = &[
    "imu",
    "base",
    "root",
    "trunk",
    "torso",
    "body",
    "odom",
    "gyro",
    "accel",
    "acc",
    "quat",
    "quaternion",
    "orientation",
    "linear",
    "lin",
    "angular",
    "ang",
    "foot",
    "contact",
];

/// The column of a header that holds this quantity of the joint; `None` if there is none, or several alike.
pub(super) fn find<'h>(
    header: &'h [String],
    joint: &str,
    quantity: Quantity,
) -> Option<&'h String> {
    let joint = parts(joint);
    let beside = |name: &'h String| Some((words_beside(&parts(name), &joint, quantity)?, name));
    let found: Vec<(usize, &String)> = header.iter().filter_map(beside).collect();
    let fewest = found.iter().map(|(words, _)| *words).min()?;
    let mut best = found.iter().filter(|(words, _)| *words == fewest);
    match (best.next(), best.next()) {
        (Some((_, name)), None) => Some(name),
        _ => None,
    }
}

/// Whether a column is about the robot's base or a target, and not the velocity of one of these joints.
pub(super) fn is_beside(name: &str, joints: &[String]) -> bool {
    let own = parts(name);
    let has = |words: &[&str]| own.iter().any(|part| words.contains(&part.as_str()));
    let is_of = |joint: &String| words_beside(&own, &parts(joint), Quantity::Velocity).is_some();
    (has(BESIDE) || has(TARGETS)) && !joints.iter().any(is_of)
}

/// How many words a column's name has beside those of the joint, if they say this quantity.
fn words_beside(name: &[String], joint: &[String], quantity: Quantity) -> Option<usize> {
    let short = joint.split_last().filter(|(last, _)| *last == "joint");
    let spellings = [Some(joint), short.map(|(_, rest)| rest)];
    let mut spellings = spellings
        .into_iter()
        .flatten()
        .filter(|joint| !joint.is_empty());
    spellings.find_map(|joint| {
        let at = name.windows(joint.len()).position(|part| part == joint)?;
        let rest = [&name[..at], &name[at + joint.len()..]].concat();
        says(&rest, quantity).then_some(rest.len())
    })
}

/// Whether words say a quantity and nothing else. A command may be said to be one of the position.
fn says(parts: &[String], quantity: Quantity) -> bool {
    let own = words(quantity);
    let fillers = match quantity {
        Quantity::Command => [FILLERS, words(Quantity::Angle)].concat(),
        _ => FILLERS.to_vec(),
    };
    let is_in = |words: &[&str], part: &String| words.contains(&part.as_str());
    parts.iter().any(|part| is_in(own, part))
        && parts
            .iter()
            .all(|part| is_in(own, part) || is_in(&fillers, part))
}

/// The letters and digits of a name between its other characters, in lower case.
fn parts(name: &str) -> Vec<String> {
    let parts = name.split(|c: char| !c.is_alphanumeric());
    parts
        .filter(|part| !part.is_empty())
        .map(str::to_lowercase)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(header: &[&str], joint: &str, quantity: Quantity) -> Option<String> {
        let header: Vec<String> = header.iter().map(|name| (*name).to_owned()).collect();
        find(&header, joint, quantity).cloned()
    }

    #[test]
    fn a_column_is_found_by_its_joint_and_its_quantity() {
        let cases = [
            ("FL_hip_pos", "FL_hip", Quantity::Angle),
            ("position/FL_hip", "FL_hip", Quantity::Angle),
            ("FL_hip_joint.q", "FL_hip_joint", Quantity::Angle),
            ("q_FL_hip", "FL_hip_joint", Quantity::Angle),
            ("joint position FL_hip", "FL_hip", Quantity::Angle),
            ("dq_FL_hip", "FL_hip", Quantity::Velocity),
            ("FL_hip_joint/velocity", "FL_hip", Quantity::Velocity),
            ("FL_hip.Effort", "FL_hip", Quantity::Torque),
            ("des_pos_FL_hip", "FL_hip", Quantity::Command),
            ("FL_hip_q_target", "FL_hip", Quantity::Command),
        ];
        for (column, joint, quantity) in cases {
            let others = ["FR_hip_pos", "q_RL_hip", "FL_hip_temperature"];
            let header = [&others[..], &[column]].concat();
            assert_eq!(found(&header, joint, quantity).as_deref(), Some(column));
        }
    }

    #[test]
    fn another_joint_or_quantity_is_not_taken() {
        for column in [
            "FL_hip_target_pos",
            "FL_hip",
            "upper_FL_hip_pos",
            "FL_hip_pos_error",
        ] {
            assert_eq!(
                found(&[column], "FL_hip", Quantity::Angle),
                None,
                "{column}"
            );
        }
        let alike = ["FL_hip_pos", "FL_hip_position"];
        assert_eq!(found(&alike, "FL_hip", Quantity::Angle), None);
        let plainer = ["measured_FL_hip_pos", "FL_hip_pos"];
        assert_eq!(
            found(&plainer, "FL_hip", Quantity::Angle).as_deref(),
            Some("FL_hip_pos")
        );
    }

    #[test]
    fn the_base_is_no_joint_unless_one_has_its_name() {
        for name in ["imu_angular_velocity_x", "base_lin_vel_z", "des_dof_vel3"] {
            assert!(is_beside(name, &[]), "{name}");
        }
        assert!(!is_beside("elbow_vel", &[]));
        assert!(!is_beside("base_vel", &["base".to_owned()]));
    }
}
