//! Like joints: those of one role on limbs that are built alike.

use super::system::Model;
use crate::data::Joint;

/// The words by which names tell limbs apart, in lower case. Numbers are none of them: along a chain they count joints of
/// different roles.
const LIMBS: [&str; 29] = [
    "left", "right", "front", "fore", "middle", "mid", "rear", "hind", "back", // words
    "l", "r", // sides
    "fl", "fr", "ml", "mr", "rl", "rr", "hl", "hr", "bl",
    "br", // front, middle, rear, hind or back, then the side
    "lf", "rf", "lm", "rm", "lh", "rh", "lb", "rb", // the side first
];

/// Groups of joints whose names differ only in the limb: `FL_hip_joint`, `FR_hip_joint`, `RL_hip_joint` and
/// `RR_hip_joint`, or `left_knee` and `right_knee`.
///
/// `names` holds one name per joint, in order, or nothing for a rig without names. Each group has at least two joints, in
/// order; groups are in the order of their first joints, and joints that are like no other are in none.
pub(super) fn of_names(names: &[String]) -> Vec<Vec<Joint>> {
    let mut groups: Vec<(String, Vec<Joint>)> = Vec::new();
    for (joint, name) in Joint::all(names.len()).zip(names) {
        let Some(role) = role(name) else {
            continue;
        };
        match groups.iter_mut().find(|(known, _)| *known == role) {
            Some((_, joints)) => joints.push(joint),
            None => groups.push((role, vec![joint])),
        }
    }
    let groups = groups.into_iter().map(|(_, joints)| joints);
    groups.filter(|joints| joints.len() > 1).collect()
}

impl Model {
    /// Groups of joints that are built alike: those that its file gives, or else those that names tell.
    pub fn like_joints(&self) -> Vec<Vec<Joint>> {
        let of_file = self.like.clone();
        of_file.unwrap_or_else(|| of_names(&self.joint_names))
    }
}

/// The name with a star for each word that names a limb; `None` if no word does.
fn role(name: &str) -> Option<String> {
    let words = words(name);
    let is_limb = |word: &&String| LIMBS.contains(&word.to_lowercase().as_str());
    words.iter().any(|word| is_limb(&word)).then(|| {
        let role = words.iter();
        role.map(|word| if is_limb(&word) { "*" } else { word })
            .collect()
    })
}

/// The words, numbers and separators of a name: `L`, `Hip`, `2` of `LHip2`.
fn words(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut words: Vec<String> = Vec::new();
    for (k, letter) in letters.iter().enumerate() {
        let begins = k == 0 || begins_word(letters[k - 1], *letter, letters.get(k + 1).copied());
        match words.last_mut().filter(|_| !begins) {
            Some(word) => word.push(*letter),
            None => words.push(letter.to_string()),
        }
    }
    words
}

fn begins_word(before: char, letter: char, after: Option<char>) -> bool {
    let kind = |letter: char| (letter.is_alphabetic(), letter.is_numeric());
    let is_next_capital =
        letter.is_uppercase() && (before.is_lowercase() || after.is_some_and(char::is_lowercase));
    kind(before) != kind(letter) || is_next_capital
}

#[cfg(test)]
mod tests {
    use super::of_names;

    /// The groups of these names, as numbers of joints.
    fn groups(names: &[&str]) -> Vec<Vec<usize>> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let groups = of_names(&names).into_iter();
        groups
            .map(|joints| joints.into_iter().map(|joint| joint.number()).collect())
            .collect()
    }

    #[test]
    fn legs_have_like_joints() {
        let of = |limbs: [&str; 4]| -> Vec<String> {
            let joints = |limb: &str| ["hip", "thigh"].map(|role| format!("{limb}_{role}_joint"));
            limbs.iter().flat_map(|limb| joints(limb)).collect()
        };
        for limbs in [["FL", "FR", "RL", "RR"], ["lf", "rf", "lh", "rh"]] {
            let names = of(limbs);
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            assert_eq!(groups(&names), [[1, 3, 5, 7], [2, 4, 6, 8]], "{names:?}");
        }
        let words = ["front_left_hip", "front_right_hip", "rear_left_hip"];
        assert_eq!(groups(&words), [[1, 2, 3]]);
        let twice = [
            "torso_to_abduct_fl_j",
            "abduct_fl_to_thigh_fl_j",
            "abduct_hr_to_thigh_hr_j",
        ];
        assert_eq!(groups(&twice), [[2, 3]]);
    }

    #[test]
    fn left_and_right_are_alike() {
        for names in [
            [
                "left_shoulder_pitch_joint",
                "waist",
                "right_shoulder_pitch_joint",
            ],
            ["l_knee", "neck", "r_knee"],
            ["leg_left_1_joint", "leg_left_2_joint", "leg_right_1_joint"],
            ["LHipPitch", "HeadYaw", "RHipPitch"],
            ["L1", "L2", "R1"],
            ["left_fr3_joint1", "left_fr3_joint2", "right_fr3_joint1"],
        ] {
            assert_eq!(groups(&names), [[1, 3]], "{names:?}");
        }
    }

    #[test]
    fn joints_along_a_chain_are_not_alike() {
        let panda = ["panda_joint1", "panda_joint2", "panda_joint3"];
        let words = ["shoulder_pan", "shoulder_lift", "elbow", "right_wrist"];
        for names in [&panda[..], &words, &["q1", "q2"], &[]] {
            assert_eq!(groups(names), Vec::<Vec<usize>>::new(), "{names:?}");
        }
    }
}
