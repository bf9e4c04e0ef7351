//! Whether the lists of a report read from a file have matching lengths, which the code that makes pages assumes.

use super::motion::MotionEntry;
use super::schema::{ErrorEntry, ModelError, Report};
use residyn_core::data::Joint;

/// The number of entries that a list must have, and the number that it has.
type Length = [usize; 2];

impl Report {
    /// What is wrong, in a clause; `None` for a report as the program writes it.
    pub(super) fn contradiction(&self) -> Option<String> {
        let (joints, horizons) = (self.joints, self.error.horizons_s.len());
        if joints == 0 || horizons == 0 {
            return Some("it has no joint or no horizon".to_owned());
        }
        let names = [self.joint_names.len(), self.prismatic.len()].map(|found| [joints, found]);
        let mut lengths = names.to_vec();
        for model in self.error.models() {
            lengths.extend(model.lengths(joints, horizons));
        }
        for log in &self.error.by_log {
            lengths.extend([log.before.len(), log.after.len()].map(|found| [joints, found]));
        }
        if let Some(torque) = &self.torque {
            let fitted = [&torque.declared, &torque.before, &torque.after];
            let models = fitted.into_iter().chain(&torque.with_friction);
            lengths.extend(models.map(|model| [joints, model.rms.len()]));
        }
        let groups = self.like_joints.iter();
        lengths.extend(groups.filter(|group| group.is_empty()).map(|_| [1, 0]));
        if let Some(motion) = &self.plots.motion {
            lengths.extend(motion.lengths());
        }
        let off = lengths.into_iter().find(|[wanted, found]| wanted != found);
        if let Some([wanted, found]) = off {
            return Some(format!("a list has {found} entries instead of {wanted}"));
        }
        let strange = self.mentioned().find(|joint| !joint.is_of(joints))?;
        Some(format!("it has no joint {strange}"))
    }
}

impl Report {
    /// Joints by which pages look up a name or a row.
    fn mentioned(&self) -> impl Iterator<Item = Joint> {
        let drawn = self.plots.residuals.iter().map(|cloud| cloud.joint);
        let like = self.like_joints.iter().flatten().copied();
        let differ = self.differences.iter();
        let differ = differ.flat_map(|one| one.joints.iter().chain(&one.others).copied());
        drawn.chain(like).chain(differ)
    }
}

impl ErrorEntry {
    fn models(&self) -> impl Iterator<Item = &ModelError> {
        let always = [&self.declared, &self.before, &self.after];
        let some = [&self.with_friction, &self.zeroed, &self.hybrid];
        let others = self.against.iter().map(|contender| &contender.error);
        always
            .into_iter()
            .chain(some.into_iter().flatten())
            .chain(others)
    }
}

impl ModelError {
    fn lengths(&self, joints: usize, horizons: usize) -> Vec<Length> {
        let errors = [
            &self.position_rmse,
            &self.position_median,
            &self.velocity_rmse,
        ];
        let outer = errors.map(Vec::len).into_iter();
        let outer = outer.chain([self.windows.len(), self.diverged.len()]);
        let inner = errors
            .into_iter()
            .flatten()
            .map(|list| [joints, list.len()]);
        outer.map(|found| [horizons, found]).chain(inner).collect()
    }
}

impl MotionEntry {
    /// A line for each frame; one of the frames is the still.
    fn lengths(&self) -> Vec<Length> {
        let frames = self.time.len();
        let moving = self.pictures.iter().flat_map(|picture| {
            let lines = [&picture.measured, &picture.before, &picture.after];
            lines.map(|line| [frames, line.len()])
        });
        let still = [frames, frames.max(self.still.saturating_add(1))];
        moving.chain([still]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::MotionEntry;

    #[test]
    fn the_frame_that_stands_still_is_one_of_the_frames() {
        let motion = |frames: usize, still| MotionEntry {
            log: String::new(),
            horizon_s: 1.0,
            time: vec![0.0; frames],
            still,
            drawn: String::new(),
            pictures: vec![],
        };
        let fits = |frames, still| {
            let lengths = motion(frames, still).lengths();
            lengths.iter().all(|[wanted, found]| wanted == found)
        };
        assert!(fits(3, 2) && !fits(3, 3) && !fits(0, 0) && !fits(1, usize::MAX));
    }
}
