use super::MonitorError;

/// How a machine is watched.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// False alarms per hour, over all hypotheses, joints and windows together.
    pub false_alarms_per_hour: f64,
    /// Length of the first stretch, in which the machine is known to be well, s. The scatter of the scores is measured in
    /// its blocks, and a change is never known better than the state of the machine in this stretch.
    pub healthy_s: f64,
    /// Length of the blocks whose scores are taken as one draw, s: several times the width of the smoothing.
    pub block_s: f64,
    /// Half the width of the window over which forces are averaged, s; `None` for 120 ms, or fifteen steps of slower logs. A
    /// joint with dry friction is watched while it moves one way for twice that long.
    pub smoothing_s: Option<f64>,
    /// Where a load at the tip is expected in the frame of the last body, m; `None` for that body's centre of mass.
    pub payload_at: Option<[f64; 3]>,
}

impl Default for Settings {
    /// One false alarm in ten hours, after five healthy minutes.
    fn default() -> Self {
        Self {
            false_alarms_per_hour: 0.1,
            healthy_s: 300.0,
            block_s: 1.0,
            smoothing_s: None,
            payload_at: None,
        }
    }
}

/// The scatter of a score is not known from fewer blocks than these.
const LEAST_BLOCKS: f64 = 20.0;

impl Settings {
    pub(crate) fn check(&self) -> Result<(), MonitorError> {
        let wrong = |setting, value, wanted| {
            Err(MonitorError::Setting {
                setting,
                value,
                wanted,
            })
        };
        if !(self.false_alarms_per_hour > 0.0 && self.false_alarms_per_hour <= 60.0) {
            let wanted = "give more than 0 and at most 60 false alarms per hour";
            return wrong(
                "the rate of false alarms",
                self.false_alarms_per_hour,
                wanted,
            );
        }
        if !(self.block_s > 0.0 && self.block_s <= 600.0) {
            let wanted = "give more than 0 and at most 600 s";
            return wrong("the length of a block", self.block_s, wanted);
        }
        if !(self.healthy_s >= LEAST_BLOCKS * self.block_s && self.healthy_s <= 1e5) {
            let wanted = "give at least 20 blocks, which are 20 s by default, and at most 1e5 s";
            return wrong("the healthy stretch", self.healthy_s, wanted);
        }
        if let Some(smoothing_s) = self.smoothing_s
            && !(smoothing_s > 0.0 && smoothing_s <= 0.25 * self.block_s)
        {
            let wanted = "give more than 0 s and at most a quarter of a block";
            return wrong("the smoothing", smoothing_s, wanted);
        }
        Ok(())
    }
}
