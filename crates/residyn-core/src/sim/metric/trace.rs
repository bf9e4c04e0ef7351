use crate::data::{Log, half_width_s};
use crate::model::Dynamics;
use crate::sim::{
    Commands, PREDICTION_S, Point, RK4, Simulator, Window, initial_state, with_own_angles,
};

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
    let model = Point::from(&*in_log);
    let commands = Commands::of_log(&model, log);
    let own = with_own_angles(&model, log);
    let half_width = half_width_s(log.median_step());
    // The windows of the error overlap by half: every second window covers the log once.
    super::open_loop::windows(0, log, horizon_s)
        .iter()
        .step_by(2)
        .map(|window| {
            let start =
                initial_state(&own, half_width, window.first).expect("windows() checks this");
            trace(&model, &commands, log, window, &start)
        })
        .collect()
}

fn trace(
    model: &Point<'_>,
    commands: &Commands<'_>,
    log: &Log,
    window: &Window,
    start: &[f64],
) -> Trace {
    let mut simulator = Simulator::new(model, RK4);
    simulator.put(start);
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
