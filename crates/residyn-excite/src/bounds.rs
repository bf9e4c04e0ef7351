//! How much of each limit a motion uses.

use serde::Serialize;

use residyn_core::data::Joint;

use crate::balance::Drive;
use crate::fourier::Motion;
use crate::limits::{JointLimits, Limits};

/// What is limited, in the order of the first three derivatives of a motion, then of the parts of [`Drive`].
pub const LIMITED: [&str; 7] = [
    "angle",
    "speed",
    "acceleration",
    "command",
    "torque",
    "command rate",
    "torque rate",
];

/// The middle of a range and half its width.
type Range = (f64, f64);

/// The limits of all joints: `[quantity][joint]`.
#[derive(Debug, Clone)]
pub struct Bounds([Vec<Option<Range>>; LIMITED.len()]);

/// How much of one limit a motion uses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Use {
    pub joint: Joint,
    /// Such as `torque rate`.
    pub quantity: &'static str,
    /// The largest distance from the middle of the admissible range, over half its width: 1 at the limit.
    pub share: f64,
}

impl Bounds {
    /// Those of a limits file.
    pub fn of(limits: &Limits) -> Self {
        let ranged = |range: [f64; 2]| ((range[0] + range[1]) / 2.0, (range[1] - range[0]) / 2.0);
        let each =
            |of: &dyn Fn(&JointLimits) -> Option<Range>| limits.joints.iter().map(of).collect();
        Self([
            each(&|joint| Some(ranged(joint.angle))),
            each(&|joint| Some((0.0, joint.speed))),
            each(&|joint| Some((0.0, joint.acceleration))),
            each(&|joint| joint.command.map(ranged)),
            each(&|joint| joint.torque.map(|most| (0.0, most))),
            each(&|joint| joint.command_rate.map(|most| (0.0, most))),
            each(&|joint| joint.torque_rate.map(|most| (0.0, most))),
        ])
    }

    /// The limited channels of a motion (`[row * joints + joint]`), in their order.
    fn channels<'c>(motion: &'c Motion, drive: &'c Drive) -> [&'c Vec<f64>; LIMITED.len()] {
        let [command, torque, command_rate, torque_rate] = drive.parts();
        [
            &motion[0],
            &motion[1],
            &motion[2],
            command,
            torque,
            command_rate,
            torque_rate,
        ]
    }

    /// How much a motion uses of each limit that there is.
    pub fn uses(&self, motion: &Motion, drive: &Drive) -> Vec<Use> {
        let mut uses = Vec::new();
        for ((ranges, channel), quantity) in self
            .0
            .iter()
            .zip(Self::channels(motion, drive))
            .zip(LIMITED)
        {
            for (joint, range) in ranges.iter().enumerate() {
                if let Some((middle, half)) = range {
                    let own = channel.iter().skip(joint).step_by(ranges.len());
                    let shares = own.map(|value| (value - middle).abs() / half);
                    // NaN counts as beyond every limit.
                    let most = |a: f64, b: f64| if b > a || b.is_nan() { b } else { a };
                    uses.push(Use {
                        joint: Joint::at(joint),
                        quantity,
                        share: shares.fold(0.0, most),
                    });
                }
            }
        }
        uses
    }

    /// Raise the uses of angle and speed to those of a simulated motion, `[joint][row]` each.
    pub fn widen(&self, uses: &mut [Use], simulated: [&Vec<Vec<f64>>; 2]) {
        for one in uses {
            let Some(quantity) = LIMITED[..2].iter().position(|name| *name == one.quantity) else {
                continue;
            };
            let joint = one.joint.index();
            if let Some((middle, half)) = self.0[quantity][joint] {
                let shares = simulated[quantity][joint].iter();
                let shares = shares.map(|value| (value - middle).abs() / half);
                one.share = shares.fold(one.share, f64::max);
            }
        }
    }

    /// The mean square by which a motion exceeds its limits, as shares of them, and its gradient: with respect to position,
    /// speed and acceleration, and to what drives.
    pub fn excess(&self, motion: &Motion, drive: &Drive) -> (f64, Motion, Drive) {
        let count = motion[0].len();
        let rows = count as f64 / self.0[0].len() as f64;
        let mut by_motion: Motion = std::array::from_fn(|_| vec![0.0; count]);
        let mut by_drive = Drive::zeros(count);
        let mut sum = 0.0;
        let slopes = by_motion[..3].iter_mut().chain(by_drive.parts_mut());
        for ((ranges, channel), slopes) in
            self.0.iter().zip(Self::channels(motion, drive)).zip(slopes)
        {
            for ((value, slope), range) in channel
                .iter()
                .zip(slopes.iter_mut())
                .zip(ranges.iter().cycle())
            {
                let Some((middle, half)) = range else {
                    continue;
                };
                let beyond = (value - middle).abs() / half - 1.0;
                if beyond > 0.0 {
                    sum += beyond.powi(2) / rows;
                    *slope += 2.0 * beyond * (value - middle).signum() / (half * rows);
                }
            }
        }
        (sum, by_motion, by_drive)
    }
}
