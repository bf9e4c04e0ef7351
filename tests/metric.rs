//! The prediction error against a plain second implementation of its definition.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use residyn_core::data::{Interval, Log};
use residyn_core::expr::SignForm;
use residyn_core::identify::calibrate;
use residyn_core::model::Dynamics;
use residyn_core::sim::metric::{Assessment, Summary, assess, summarise};

use crate::support::catalogue::{dynamics, effect, rng, system};
use crate::support::logs::{empty_log, simulate};
use crate::support::oracles::{ORACLES, Oracle};

/// Halving the integrator's step may change a number by 0.1 %; the rest is rounding.
const SHARE: f64 = 1e-3;
/// Rounded decimals: a row that is meant to be at an edge counts as being there.
const SLACK_S: f64 = 1e-9;
const HORIZONS_S: [f64; 3] = [0.1, 0.5, 1.0];

/// The quantities of the definition at one horizon, one number per joint.
struct Naive {
    position_rmse: Vec<f64>,
    position_median: Vec<f64>,
    velocity_rmse: Vec<f64>,
    /// Log and time of every window's first row.
    starts: Vec<(usize, f64)>,
}

fn half_width(log: &Log) -> f64 {
    let mut steps: Vec<f64> = log.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let n = steps.len();
    let median = 0.5 * (steps[(n - 1) / 2] + steps[n / 2]);
    f64::max(0.016, 4.0 * median)
}

/// First rows of the windows.
fn starts(log: &Log, horizon: f64) -> Vec<usize> {
    let w = half_width(log);
    let end = log.time[log.rows() - 1];
    let begin = *log
        .time
        .iter()
        .find(|t| **t - log.time[0] >= w - SLACK_S)
        .unwrap();
    let nominal = (0..1000).map(|k| begin + f64::from(k) * horizon / 2.0);
    nominal
        .filter_map(|start| log.time.iter().position(|t| *t >= start - SLACK_S))
        .filter(|row| log.time[*row] + horizon <= end + SLACK_S)
        .filter(|row| {
            let (from, to) = (log.time[*row], log.time[*row] + horizon);
            log.leave_out
                .iter()
                .all(|out| out.end_s < from || out.start_s > to)
        })
        .collect()
}

/// Position and velocity at a row by a cubic through the positions on either side.
fn estimate(log: &Log, joint: usize, row: usize) -> [f64; 2] {
    let w = half_width(log);
    let near: Vec<usize> = (0..log.rows())
        .filter(|i| (log.time[*i] - log.time[row]).abs() <= w + SLACK_S)
        .collect();
    let design = DMatrix::from_fn(near.len(), 4, |i, power| {
        ((log.time[near[i]] - log.time[row]) / w).powi(power as i32)
    });
    let values = DVector::from_iterator(near.len(), near.iter().map(|i| log.q[joint][*i]));
    let c = design.svd(true, true).solve(&values, 1e-12).unwrap();
    [c[0], c[1] / w]
}

/// Held steps of at most 0.1 ms, by the classical Runge-Kutta method.
fn advance(oracle: Oracle, state: &mut [f64], tau: &[f64], values: &[f64], dt: f64) {
    let n = tau.len();
    let rates = |state: &[f64]| {
        let inputs = [state, tau, &[0.0], values].concat();
        [state[n..].to_vec(), oracle(&inputs)].concat()
    };
    let along = |state: &[f64], rates: &[f64], h: f64| -> Vec<f64> {
        state.iter().zip(rates).map(|(x, r)| x + h * r).collect()
    };
    let steps = (dt / 1e-4).ceil();
    let h = dt / steps;
    for _ in 0..steps as usize {
        let a = rates(state);
        let b = rates(&along(state, &a, h / 2.0));
        let c = rates(&along(state, &b, h / 2.0));
        let d = rates(&along(state, &c, h));
        for i in 0..2 * n {
            state[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
        }
    }
}

/// Squared errors `[row][joint]` of position and velocity over one window.
fn window(
    oracle: Oracle,
    values: &[f64],
    log: &Log,
    first: usize,
    horizon: f64,
) -> Vec<Vec<[f64; 2]>> {
    let n = log.joints();
    let start: Vec<[f64; 2]> = (0..n).map(|j| estimate(log, j, first)).collect();
    let mut state: Vec<f64> = start
        .iter()
        .map(|s| s[0])
        .chain(start.iter().map(|s| s[1]))
        .collect();
    let mut errors = Vec::new();
    let mut row = first;
    while row + 1 < log.rows() && log.time[row + 1] <= log.time[first] + horizon + SLACK_S {
        let tau: Vec<f64> = log.tau.iter().map(|tau| tau[row]).collect();
        advance(
            oracle,
            &mut state,
            &tau,
            values,
            log.time[row + 1] - log.time[row],
        );
        row += 1;
        let error = |j: usize| [state[j] - log.q[j][row], state[n + j] - log.qd[j][row]];
        errors.push((0..n).map(|j| error(j).map(|e| e * e)).collect());
    }
    errors
}

fn naive(oracle: Oracle, values: &[f64], logs: &[Log], horizon: f64) -> Naive {
    let n = logs[0].joints();
    let mut windows: Vec<Vec<Vec<[f64; 2]>>> = Vec::new();
    let mut all_starts = Vec::new();
    for (index, log) in logs.iter().enumerate() {
        for first in starts(log, horizon) {
            all_starts.push((index, log.time[first]));
            windows.push(window(oracle, values, log, first, horizon));
        }
    }
    let rms = |rows: &mut dyn Iterator<Item = f64>| {
        let squares: Vec<f64> = rows.collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let over_all =
        |j: usize, what: usize| rms(&mut windows.iter().flatten().map(|row| row[j][what]));
    let median = |j: usize| {
        let mut own: Vec<f64> = windows
            .iter()
            .map(|rows| rms(&mut rows.iter().map(|row| row[j][0])))
            .collect();
        own.sort_by(f64::total_cmp);
        0.5 * (own[(own.len() - 1) / 2] + own[own.len() / 2])
    };
    Naive {
        position_rmse: (0..n).map(|j| over_all(j, 0)).collect(),
        position_median: (0..n).map(median).collect(),
        velocity_rmse: (0..n).map(|j| over_all(j, 1)).collect(),
        starts: all_starts,
    }
}

/// A log of the same motion as if read by a noisy rig at irregular times: some rows are dropped.
fn worn(mut log: Log, seed: u64) -> Log {
    let mut rng = rng(seed);
    let kept: Vec<usize> = (0..log.rows())
        .filter(|_| rng.random_range(0.0..1.0) < 0.85)
        .collect();
    log.time = kept.iter().map(|row| log.time[*row]).collect();
    for channel in log.q.iter_mut().chain(&mut log.qd).chain(&mut log.tau) {
        *channel = kept
            .iter()
            .map(|row| channel[*row] + rng.random_range(-2e-3..2e-3))
            .collect();
    }
    log
}

fn logs(model: &Dynamics) -> Vec<Log> {
    let start = |shift: f64| -> Vec<f64> {
        (0..model.states())
            .map(|k| shift - 0.4 * k as f64)
            .collect()
    };
    let mut logs = vec![
        simulate(model, &start(1.0), 1.5, 400, 1),
        worn(simulate(model, &start(0.5), 1.5, 500, 2), 3),
    ];
    logs[1].leave_out = vec![
        Interval {
            start_s: 1.62,
            end_s: 1.75,
        },
        Interval {
            start_s: 4.4,
            end_s: 9.0,
        },
    ];
    logs
}

fn score(
    model: &Dynamics,
    values: &[f64],
    logs: &[Log],
    horizons: &[f64],
) -> (Assessment, Summary) {
    let model = model.clone().with_values(values.iter().copied());
    let found = assess(&model, logs, horizons);
    let summary = summarise(&found.horizons, model.joints);
    (found, summary)
}

fn assert_close(found: &[f64], wanted: &[f64], what: &str) {
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().zip(wanted) {
        assert!(
            (found / wanted - 1.0).abs() < SHARE,
            "{what}: {found}, by definition {wanted}"
        );
    }
}

#[test]
fn the_error_is_what_its_definition_says() {
    for (name, oracle) in ORACLES {
        let model = dynamics(&system(name), &[], SignForm::Exact);
        let logs = logs(&model);
        // A model that is off by a tenth.
        let values: Vec<f64> = model.values().iter().map(|value| 0.9 * value).collect();
        let (found, summary) = score(&model, &values, &logs, &HORIZONS_S);
        for (k, horizon) in HORIZONS_S.into_iter().enumerate() {
            let wanted = naive(oracle, &values, &logs, horizon);
            let windows = &found.horizons[k].windows;
            let starts: Vec<(usize, f64)> = windows.iter().map(|w| (w.log, w.start_s)).collect();
            assert_eq!(starts, wanted.starts, "{name} at {horizon} s");
            let what = format!("{name} at {horizon} s");
            assert_close(&summary.position_rmse[k], &wanted.position_rmse, &what);
            assert_close(&summary.position_median[k], &wanted.position_median, &what);
            assert_close(&summary.velocity_rmse[k], &wanted.velocity_rmse, &what);
            assert_eq!((summary.windows[k], summary.diverged[k]), (starts.len(), 0));
        }
        assert_eq!(summary.horizons_s, HORIZONS_S);
    }
}

fn start_times(model: &Dynamics, log: &Log, horizon: f64) -> Vec<f64> {
    let (found, _) = score(
        model,
        &model.values(),
        std::slice::from_ref(log),
        &[horizon],
    );
    found.horizons[0]
        .windows
        .iter()
        .map(|window| window.start_s)
        .collect()
}

#[test]
fn windows_start_every_half_horizon_from_the_first_row_with_enough_before_it() {
    let model = dynamics(&system("drive"), &[], SignForm::Exact);
    // At 100 Hz the half width is four steps, 40 ms.
    let log = simulate(&model, &[0.0, 0.0], 1.0, 200, 1);
    assert_eq!(start_times(&model, &log, 0.8), [0.04, 0.44, 0.84]);
    // At 1 kHz it is 16 ms.
    let mut fast = empty_log("fast", 1);
    fast.time = (0..1000).map(|row| 1e-3 * f64::from(row)).collect();
    fast.q[0] = vec![0.0; 1000];
    (fast.qd, fast.tau) = (fast.q.clone(), fast.q.clone());
    assert_eq!(start_times(&model, &fast, 0.6), [0.016, 0.316]);
}

#[test]
fn a_window_that_touches_what_is_left_out_is_dropped() {
    let model = dynamics(&system("drive"), &[], SignForm::Exact);
    let mut log = simulate(&model, &[0.0, 0.0], 1.0, 300, 1);
    let whole = start_times(&model, &log, 0.4);
    assert_eq!(whole.len(), 13);
    log.leave_out = vec![Interval {
        start_s: 1.43,
        end_s: 1.66,
    }];
    let left: Vec<f64> = whole
        .iter()
        .copied()
        .filter(|t| t + 0.4 < 1.43 || *t > 1.66)
        .collect();
    assert_eq!(start_times(&model, &log, 0.4), left);
    // From the window that overlaps its start by 10 ms to the one that starts 20 ms before its end.
    assert_eq!(left.len(), 9);
}

#[test]
fn a_window_that_diverges_counts() {
    // Friction that drives: the speed grows by e^60 in a second.
    let drive = effect("viscous_friction", 0, &[-20.0]);
    let model = dynamics(&system("pendulum"), &[drive], SignForm::Exact);
    let tame = dynamics(&system("pendulum"), &[], SignForm::Exact);
    let logs = [simulate(&tame, &[1.0, 0.0], 1.0, 500, 1)];
    let (_, wild) = score(&model, &model.values(), &logs, &[0.1, 1.0]);
    let (_, calm) = score(&tame, &tame.values(), &logs, &[0.1, 1.0]);
    assert_eq!(wild.windows, calm.windows);
    assert_eq!(wild.diverged, [0, wild.windows[1]]);
    assert_eq!(calm.diverged, [0, 0]);
    // Larger than any real motion, and still finite.
    assert!(wild.position_rmse[1][0] > 100.0 && wild.position_rmse[1][0].is_finite());
}

fn shifted(model: &Dynamics, start: &[f64], offset: f64, seed: u64) -> Log {
    let mut log = simulate(model, start, 1.0, 1000, seed);
    log.q[0].iter_mut().for_each(|q| *q += offset);
    log.path = format!("run{seed}.csv").into();
    log
}

#[test]
fn calibration_finds_each_logs_offset_and_scores_the_rest() {
    let model = dynamics(&system("pendulum"), &[], SignForm::Exact);
    let values = model.values();
    // Logged angle = true angle + offset, which differs from log to log.
    let offsets = [0.05, -0.08];
    let mut logs = vec![
        shifted(&model, &[1.0, 0.0], offsets[0], 1),
        shifted(&model, &[2.5, 0.5], offsets[1], 2),
    ];
    let (_, before) = score(&model, &values, &logs, &[0.5]);
    let found = calibrate(&model, &mut logs, 0.3).unwrap();
    for (found, wanted) in found.offsets.iter().zip(offsets) {
        // The logs have no noise; the integrators agree to 1e-9.
        assert!((found[0] - wanted).abs() < 1e-6, "{found:?} for {wanted}");
    }
    let after = assess(&found.dynamics, &logs, &[0.5]);
    assert!(
        after.horizons[0]
            .windows
            .iter()
            .all(|window| window.start_s > 3.0)
    );
    assert!(after.horizons[0].windows.len() > 40);
    let after = summarise(&after.horizons, 1);
    assert!(before.position_rmse[0][0] > 0.01);
    assert!(after.position_rmse[0][0] < 0.02 * before.position_rmse[0][0]);
}

#[test]
fn calibration_wants_a_share_between_none_and_all() {
    let model = dynamics(&system("pendulum"), &[], SignForm::Exact);
    let mut logs = [simulate(&model, &[1.0, 0.0], 1.0, 500, 1)];
    let untouched = logs.clone();
    for share in [0.0, 1.0, -0.5, f64::NAN] {
        assert!(calibrate(&model, &mut logs, share).is_err());
    }
    // 100 ms are too short for a window.
    assert!(calibrate(&model, &mut logs, 0.02).is_err());
    assert_eq!(logs, untouched);
}
