use residyn_control::control::Policy;
use residyn_excite::{Design, Drives};

use super::tracking::Tracking;

/// Follows a designed motion: what drives the model along it, and feedback around its reference. A rig that is not where the motion
/// begins is brought there first.
pub struct Follow<'d> {
    design: &'d Design,
    tracking: Tracking,
    /// Greatest speed of each joint on the way to the start, per s.
    speeds: Vec<f64>,
    /// Where and when the rig was first seen.
    from: Option<(Vec<f64>, f64)>,
}

impl<'d> Follow<'d> {
    /// Along a design with these gains, not faster than `speeds` on the way to its start.
    pub fn new(design: &'d Design, tracking: Tracking, speeds: Vec<f64>) -> Self {
        Self {
            design,
            tracking,
            speeds,
            from: None,
        }
    }

    /// How long the way from `q` to the start takes, s. A cubic from rest to rest has 1.5 times its mean speed in the middle.
    pub fn approach_s(&self, q: &[f64]) -> f64 {
        let ways = self.design.q.iter().zip(q).zip(&self.speeds);
        let times = ways.map(|((reference, q), speed)| 1.5 * (reference[0] - q).abs() / speed);
        times.fold(0.0, f64::max)
    }

    /// Reference position, reference speed and feed-forward of a joint at a time since the rig was first seen.
    fn reference(&self, joint: usize, from: &[f64], since_s: f64, approach_s: f64) -> [f64; 3] {
        let Design {
            q,
            qd,
            command,
            driven_by,
            step_s,
            ..
        } = self.design;
        if since_s < approach_s {
            let share = since_s / approach_s;
            let way = q[joint][0] - from[joint];
            let now = from[joint] + way * share * share * (3.0 - 2.0 * share);
            let ahead = match driven_by {
                Drives::Torque => 0.0,
                Drives::Command => now - q[joint][0],
            };
            let speed = way * 6.0 * share * (1.0 - share) / approach_s;
            return [now, speed, command[joint][0] + ahead];
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let row = ((since_s - approach_s) / step_s).round() as usize;
        let row = row.min(q[joint].len() - 1);
        [q[joint][row], qd[joint][row], command[joint][row]]
    }
}

impl Policy for Follow<'_> {
    fn torque(&mut self, measured: &[f64], time_s: f64) -> Option<Vec<f64>> {
        let joints = self.design.q.len();
        let (now, speeds) = measured.split_at(joints);
        let (from, begun_s) = self
            .from
            .get_or_insert_with(|| (now.to_vec(), time_s))
            .clone();
        let approach_s = self.approach_s(&from);
        let of_joint = |joint: usize| {
            let [q, qd, feed] = self.reference(joint, &from, time_s - begun_s, approach_s);
            let Tracking { stiffness, damping } = &self.tracking;
            feed + stiffness[joint] * (q - now[joint]) + damping[joint] * (qd - speeds[joint])
        };
        Some((0..joints).map(of_joint).collect())
    }
}
