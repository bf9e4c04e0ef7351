//! Models of arms, and logs of their motion.

use std::f64::consts::TAU;

use rand::RngExt;
use residyn_core::data::{Log, TorqueColumn};
use residyn_core::model::Model;
use residyn_core::model::tree::Tree;

use super::catalogue::rng;
use super::mechanisms::system;

/// The model of a tree, its bodies only, without the effects on the joints.
pub fn model(tree: &Tree) -> Model {
    system(tree).with_effects(Vec::new())
}

/// The model with every body off by 10 to 25 %, the same in shape: still physical.
pub fn as_built(model: &Model) -> Model {
    let mut built = model.clone();
    for (k, body) in model.inertias().into_iter().enumerate() {
        let factor = [1.2, 0.85, 1.15, 0.9, 1.25][k];
        for parameter in body {
            built.parameters[parameter].value *= factor;
        }
    }
    built
}

/// A log of sines of several frequencies in each joint, with the torques that a model needs for them.
pub fn moved(model: &Model, seconds: f64, seed: u64) -> Log {
    let mut rng = rng(seed);
    let mut waves = || -> Vec<[f64; 3]> {
        let wave = |f: usize| {
            let phase = rng.random_range(0.0..TAU);
            [0.5 / (1.0 + f as f64), TAU * 0.13 * (1.0 + f as f64), phase]
        };
        (0..5).map(wave).collect()
    };
    let joints: Vec<Vec<[f64; 3]>> = (0..model.joints).map(|_| waves()).collect();
    let balance = model.torque_balance().unwrap();
    let (values, n) = (balance.values(), model.joints);
    let mut log = Log::empty(n).with_torques(TorqueColumn::Sampled);
    for row in 0..(200.0 * seconds) as usize {
        let t = 0.005 * row as f64;
        let sum = |wave: &dyn Fn(&[f64; 3]) -> f64| -> Vec<f64> {
            joints
                .iter()
                .map(|waves| waves.iter().map(wave).sum())
                .collect()
        };
        let q = sum(&|[a, w, p]| a * (w * t + p).sin());
        let qd = sum(&|[a, w, p]| a * w * (w * t + p).cos());
        let qdd = sum(&|[a, w, p]| -a * w * w * (w * t + p).sin());
        let mut tau = vec![0.0; n];
        // Effects that depend on the torque make the difference exact only to first order.
        for _ in 0..3 {
            let inputs = [&q, &qd, &tau, &vec![t][..], &qdd, &values].concat();
            let off = balance.program.eval(&inputs);
            tau.iter_mut().zip(off).for_each(|(tau, off)| *tau += off);
        }
        log.time.push(t);
        for j in 0..n {
            log.q[j].push(q[j]);
            log.qd[j].push(qd[j]);
            log.tau[j].push(tau[j]);
        }
    }
    log
}
