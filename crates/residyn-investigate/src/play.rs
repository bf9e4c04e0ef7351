use std::num::NonZeroU32;
use std::path::Path;

use rand_chacha::ChaCha8Rng;
use residyn_control::control::{DriveError, Driven, Policy, Simulated, drive};
use residyn_core::data::Log;
use residyn_core::plant::{Noise, Rig};
use residyn_core::sim::Integrator;
use residyn_plants::{Controlled, Simulation};

/// Substeps of a simulated rig within one of its steps.
const SUBSTEPS: NonZeroU32 = NonZeroU32::new(20).expect("above zero");

/// Let a policy drive a plant for so long, from `start` (positions, at rest) if it can be put there. A plant in another process
/// keeps the rows in `log` as they come.
pub fn play(
    plant: &Controlled,
    policy: &mut dyn Policy,
    (start, duration_s, step_s): (&[f64], f64, f64),
    (seed, noise): (u64, ChaCha8Rng),
    log: &Path,
) -> Result<Log, DriveError> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    let steps = (duration_s / step_s).round() as usize;
    let start = [start, &vec![0.0; start.len()]].concat();
    let mut driven = |plant: &mut dyn Driven| Ok(drive(plant, policy, steps)?.log);
    match plant {
        Controlled::Simulated(simulation) => {
            let rig = rig(simulation, &start, step_s);
            driven(&mut Simulated { rig, noise })
        }
        Controlled::Elsewhere(fleet) => fleet.during(Some(&start), seed, Some(log), driven),
    }
}

fn rig<'s>(simulation: &'s Simulation, start: &[f64], step_s: f64) -> Rig<'s> {
    let plant = &simulation.plant;
    let noise = Noise {
        position: plant.sensor.position_noise,
        velocity: 0.0,
    };
    let start = plant.as_read(start);
    let fine = Integrator::fine(SUBSTEPS);
    Rig::new(&simulation.dynamics, &start, fine, step_s, noise)
}
