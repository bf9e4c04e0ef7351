//! The key `like` of a model file: which joints are built alike.

use super::reader::FileError;
use super::tables::SystemTable;
use super::values::JointKey;
use crate::data::Joint;

/// The groups, each of two joints or more; no joint is in two of them.
pub(super) fn groups(system: &SystemTable<'_>) -> Result<Option<Vec<Vec<Joint>>>, FileError> {
    let Some(given) = &system.like else {
        return Ok(None);
    };
    let mut taken: Vec<Joint> = Vec::new();
    let mut groups = Vec::new();
    for group in given {
        if let [alone] = &group[..] {
            let message = format!(
                "`{}` is alone in its group; give the joints that are built like it, or leave it out",
                alone.key
            );
            return Err(system.section.document.error(alone.at, message));
        }
        let mut own = Vec::new();
        for key in group {
            let joint = joint(system, key)?;
            if taken.contains(&joint) {
                let message = format!("joint `{}` is in two groups, or twice in one", key.key);
                return Err(system.section.document.error(key.at, message));
            }
            taken.push(joint);
            own.push(joint);
        }
        own.sort_unstable();
        groups.push(own);
    }
    groups.sort_unstable();
    Ok(Some(groups))
}

/// The joint of a name or a number.
fn joint(system: &SystemTable<'_>, JointKey { key, at }: &JointKey) -> Result<Joint, FileError> {
    let named = system.joint_names.iter().position(|name| name == key);
    let numbered = || key.parse().ok().and_then(Joint::numbered);
    let joint = named.map(Joint::at).or_else(numbered);
    joint
        .filter(|joint| joint.is_of(system.joints))
        .ok_or_else(|| {
            let known = match &system.joint_names[..] {
                [] => format!("the joints are 1 to {}", system.joints),
                names => format!("the joints are {}", names.join(", ")),
            };
            let message = format!("there is no joint `{key}`; {known}");
            system.section.document.error(*at, message)
        })
}
