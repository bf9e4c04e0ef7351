use std::path::Path;

use residyn_control::control::{DriveError, Policy, drive};
use residyn_core::data::Log;
use residyn_core::plant::{Excitation, Tones};
use residyn_core::rng;
use residyn_core::streams::{Purpose, stream};
use residyn_plants::{Commanded, Description, Fleet, plant_seed};

/// Of the way from the middle of a joint's commands to their limits, as the usual rig is driven: peaks stay below them.
const AMPLITUDE: f64 = 0.5;

/// The log of a plant in another process under a multisine, drawn with `seed`, of all joints within the limits of their
/// commands; its rows are in `out` as they come.
pub(super) fn record(
    fleet: &Fleet,
    duration_s: f64,
    seed: u64,
    out: &Path,
) -> Result<Log, DriveError> {
    let plant = fleet.description();
    let mut multisine = Multisine::new(plant, seed);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    let steps = (duration_s / plant.step_s).round().max(1.0) as usize;
    let seed = plant_seed(&stream(seed, Purpose::Start(0)));
    fleet.during(None, seed, Some(out), |plant| {
        Ok(drive(plant, &mut multisine, steps)?.log)
    })
}

/// Commands that depend on time alone.
struct Multisine {
    middle: Vec<f64>,
    tones: Tones,
}

impl Multisine {
    fn new(plant: &Description, seed: u64) -> Self {
        let ranges = &plant.limits.command;
        let excitation = Excitation {
            amplitude: (ranges.iter())
                .map(|[low, high]| AMPLITUDE * 0.5 * (high - low))
                .collect(),
            ..Excitation::usual(ranges.len())
        };
        let middle = ranges.iter().map(|[low, high]| 0.5 * (low + high));
        Self {
            middle: match plant.command {
                Commanded::Torque => plant.safe.clone(),
                Commanded::Position => middle.collect(),
            },
            tones: excitation.draw(&mut rng(seed)),
        }
    }
}

impl Policy for Multisine {
    fn torque(&mut self, _: &[f64], time_s: f64) -> Option<Vec<f64>> {
        let tones = self.tones.at(time_s);
        let around = self.middle.iter().zip(tones);
        Some(around.map(|(middle, tone)| middle + tone).collect())
    }
}
