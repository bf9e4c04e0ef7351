use residyn_core::data::Log;
use serde::{Deserialize, Serialize};

/// Least and greatest value.
pub type Span = [f64; 2];

/// Where the motion of some logs was: outside of it, nothing is known of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// Of each joint, rad (or m).
    pub angle: Vec<Span>,
    /// Of each joint, rad/s (or m/s).
    pub speed: Vec<Span>,
    /// Of each joint: torques in N m (or N), or commands.
    pub driven: Vec<Span>,
}

impl Region {
    /// Of logs of the same rig.
    pub fn of(logs: &[Log]) -> Self {
        let joints = logs.first().map_or(0, Log::joints);
        let spans = |channel: &dyn Fn(&Log) -> &[Vec<f64>]| -> Vec<Span> {
            let of_joint = |joint: usize| {
                let all = logs.iter().flat_map(|log| &channel(log)[joint]);
                all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                    [low.min(*value), high.max(*value)]
                })
            };
            (0..joints).map(of_joint).collect()
        };
        Self {
            angle: spans(&|log| &log.q),
            speed: spans(&|log| &log.qd),
            driven: spans(&|log| &log.tau),
        }
    }
}
