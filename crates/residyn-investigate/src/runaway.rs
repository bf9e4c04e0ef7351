use residyn_core::data::Joint;
use residyn_excite::Limits;

/// A joint this many times as fast as its limit is no longer held by the feedback.
const FACTOR: f64 = 2.0;
/// So many rows in turn: speeds that are differences of angles have noise.
const ROWS: usize = 3;

/// A joint that does not follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Runaway {
    pub joint: Joint,
    /// Measured, rad/s (or m/s).
    pub speed: f64,
    pub limit: f64,
}

/// Sees whether a joint runs away from its motion.
#[derive(Debug, Clone, Default)]
pub struct Lookout {
    /// Rows in turn in which each joint was too fast.
    rows: Vec<usize>,
    seen: Option<Runaway>,
}

impl Lookout {
    /// The first joint that ran away until now.
    pub fn see(&mut self, qd: &[f64], limits: &Limits) -> Option<Runaway> {
        self.rows.resize(qd.len(), 0);
        for (joint, rows) in Joint::all(qd.len()).zip(&mut self.rows) {
            let (speed, limit) = (qd[joint].abs(), limits.joints[joint].speed);
            *rows = match speed > FACTOR * limit {
                true => *rows + 1,
                false => 0,
            };
            if *rows == ROWS {
                self.seen.get_or_insert(Runaway {
                    joint,
                    speed,
                    limit,
                });
            }
        }
        self.seen
    }

    pub fn seen(&self) -> Option<Runaway> {
        self.seen
    }
}
