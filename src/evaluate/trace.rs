use crate::data::{Log, half_width_s};
use crate::identify::{Window, initial_state};
use crate::lanes::Row;
use crate::model::{Commands, Dynamics, Rollout, Sensors, StepTorque, with_own_angles};

/// One open-loop prediction: times in s and, for each joint, angles in rad (or m).
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    pub time: Vec<f64>,
    /// `[joint][row]`
    pub q: Vec<Vec<f64>>,
}

/// Predictions of `horizon_s` seconds one after the other along a log, each started from the log: what a
/// picture of an open-loop error shows.
pub fn traces(dynamics: &Dynamics, log: &Log, horizon_s: f64) -> Vec<Trace> {
    let values = &dynamics.in_log(log).values();
    let commands = Commands::of_log(dynamics, values, log);
    let own = with_own_angles(dynamics, values, log);
    // Windows for the error overlap by half; a picture wants each second one.
    super::open_loop::windows(0, log, horizon_s)
        .iter()
        .step_by(2)
        .map(|window| {
            let start = initial_state(&own, half_width_s(log.median_step()), window.first)
                .expect("windows() checks this");
            trace(dynamics, values, &commands, log, window, &start)
        })
        .collect()
}

fn trace(
    dynamics: &Dynamics,
    values: &[f64],
    commands: &Commands<'_>,
    log: &Log,
    window: &Window,
    start: &[f64],
) -> Trace {
    let mut state: Vec<Row<f64, 1>> = start.iter().map(|value| Row([*value])).collect();
    let mut rollout = Rollout::<f64, 1>::new(dynamics, values);
    let mut sensors = Sensors::<1>::new(dynamics, values);
    let before = |row: usize| move || Commands::just_before([commands], [row]);
    let mut trace = Trace {
        time: Vec::new(),
        q: vec![Vec::new(); dynamics.joints],
    };
    for row in window.first..=window.last {
        trace.time.push(log.time[row]);
        let shown = sensors.show(&state, before(row), Row([log.time[row]]));
        for (q, value) in trace.q.iter_mut().zip(shown) {
            q.push(value[0]);
        }
        if row < window.last {
            let (from, to) = (log.time[row], log.time[row + 1]);
            let dt = to - from;
            let tau: Vec<Row<f64, 1>> = log.tau.iter().map(|tau| Row([tau[row]])).collect();
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // a small positive number
            let substeps = ((dt / super::open_loop::LONGEST_STEP_S).ceil() as usize).max(1);
            let torque = StepTorque::new([commands], &tau, Row([from]), Row([to]), substeps);
            rollout.advance(&mut state, &torque.mean, Row([from]), Row([dt]), substeps);
        }
    }
    trace
}
