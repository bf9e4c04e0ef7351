//! Logs of simulated motion, in memory.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_distr::{Distribution, Normal};
use residyn_core::data::Log;
use residyn_core::lanes::Row;
use residyn_core::model::Dynamics;
use residyn_core::sim::{Commands, Hold, RK4, Simulator};

use super::catalogue::rng;

/// A log without rows.
pub fn empty_log(name: &str, joints: usize) -> Log {
    Log {
        path: name.into(),
        ..Log::empty(joints)
    }
}

/// A log of `rows` steps of 10 ms without noise: torques of a few sines up to `torque`, held over each step.
pub fn simulate(model: &Dynamics, start: &[f64], torque: f64, rows: usize, seed: u64) -> Log {
    let n = model.joints;
    let mut rng = rng(seed);
    let tones: Vec<[f64; 2]> = (0..4 * n)
        .map(|_| [rng.random_range(0.5..12.0), rng.random_range(0.0..TAU)])
        .collect();
    let mut log = empty_log(&format!("{seed}.csv"), n);
    log.driven_by = model.driven_by();
    log.time = (0..=rows).map(|row| 0.01 * row as f64).collect();
    for (j, tau) in log.tau.iter_mut().enumerate() {
        let wave = |time: f64| {
            let tones = tones[4 * j..][..4].iter();
            tones.map(|[w, p]| (w * time + p).sin()).sum::<f64>()
        };
        *tau = log.time.iter().map(|t| 0.25 * torque * wave(*t)).collect();
    }
    let (time, tau) = (log.time.clone(), log.tau.clone());
    let commands = [&Commands::new(model, &time, &tau)];
    let mut simulator = Simulator::new(model, RK4);
    simulator.put(start);
    for row in 0..=rows {
        let time = log.time[row];
        let [angles, velocities] = simulator.shown(commands, [row]);
        for j in 0..n {
            log.q[j].push(angles[j][0]);
            log.qd[j].push(velocities[j][0]);
        }
        let held: Vec<Row<f64, 1>> = log.tau.iter().map(|tau| Row([tau[row]])).collect();
        simulator.advance(&Hold::lasting(commands, &held, Row([time]), 0.01, 20));
    }
    log
}

/// Add noise of this standard deviation (rad) to the angles.
pub fn add_noise(log: &mut Log, deviation: f64, seed: u64) {
    let (normal, mut rng) = (Normal::new(0.0, deviation).unwrap(), rng(seed));
    for q in log.q.iter_mut().flatten() {
        *q += normal.sample(&mut rng);
    }
}
