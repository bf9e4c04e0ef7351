use super::open_loop::{Replay, windows};
use crate::data::Log;
use crate::model::Dynamics;
use crate::sim::{PREDICTION_S, RK4, Simulator, Window};

/// One open-loop prediction: times in s and, for each joint, angles in rad (or m).
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    pub time: Vec<f64>,
    /// `[joint][row]`
    pub q: Vec<Vec<f64>>,
}

/// Consecutive predictions of `horizon_s` seconds along a log, each started from the log, for pictures.
pub fn traces(dynamics: &Dynamics, log: &Log, horizon_s: f64) -> Vec<Trace> {
    let in_log = dynamics.in_log(log);
    let replay = Replay::new(&in_log, log);
    // The windows of the error overlap by half: every second window covers the log once.
    let windows = windows(0, log, horizon_s).into_iter().step_by(2);
    windows.map(|window| trace(&replay, log, &window)).collect()
}

fn trace(replay: &Replay<'_>, log: &Log, window: &Window) -> Trace {
    let commands = &replay.commands;
    let mut simulator = Simulator::new(&replay.model, RK4);
    simulator.put(&replay.start(window));
    let mut trace = Trace {
        time: Vec::new(),
        q: vec![Vec::new(); log.q.len()],
    };
    for row in window.first..=window.last {
        if row > window.first {
            simulator.follow([commands], [row - 1], PREDICTION_S);
        }
        trace.time.push(log.time[row]);
        let [angles, _] = simulator.shown([commands], [row]);
        for (q, angle) in trace.q.iter_mut().zip(angles) {
            q.push(angle[0]);
        }
    }
    trace
}
