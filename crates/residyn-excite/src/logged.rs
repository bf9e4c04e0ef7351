//! How well logs excite a model: what their motion cannot tell, and the one further run that would tell most.

use nalgebra::DMatrix;
use serde::Serialize;

use residyn_core::data::{Joint, Log, Smooth, Smoothing};
use residyn_core::decomposition::eigen;
use residyn_core::model::Model;
use residyn_core::streams::{Purpose, stream};

use crate::balance::{Along, Balance};
use crate::criterion::{Criterion, log_determinant};
use crate::design::{Expected, expected};
use crate::error::ExciteError;
use crate::fourier::{Motion, Series};
use crate::limits::{JointLimits, Limits};
use crate::problem::Problem;

/// Commands of two joints are the same but for a factor above this correlation: fewer than one percent of their squares
/// differ.
const COLLINEAR: f64 = 0.995;
/// A joint that moves in one direction for all but this share of its motion does not reverse.
const RARE: f64 = 0.01;
/// Gravity that varies by less than this share of what it can is not swept.
const SWEPT: f64 = 0.2;
/// Gravity that is a smaller share of the joint's logged torque does not matter.
const GRAVITY_MATTERS: f64 = 0.02;
/// A sum of parameters is not told if its standard deviation is a larger share of its size: its 95 % interval then
/// extends to seven times its size, as in the core's identifiability.
const LOOSE: f64 = 3.0;
/// Parameters with a smaller weight in such a sum are not named.
const NAMED: f64 = 0.3;
/// Length of the proposed run, s.
const RUN_S: f64 = 10.0;
/// Harmonics of the proposed runs, and how many random ones of each kind are compared.
const RUN_HARMONICS: usize = 6;
const RUNS: usize = 8;
/// The least range of angle (rad or m) and the least speed and acceleration (per s and s^2) of a proposed run.
const LEAST: [f64; 3] = [1.0, 0.5, 2.0];
/// How much slower the slow ones are.
const SLOWER: f64 = 4.0;
/// Angles at which gravity is read, over a turn (or 1 m) of each joint.
const AROUND: usize = 24;

/// What logs tell and do not tell of a model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Excitation {
    /// Pairs of joints whose commands are the same but for a factor.
    pub collinear: Vec<Collinear>,
    /// Joints whose speed hardly ever reverses: friction there looks like a constant torque.
    pub one_way: Vec<OneWay>,
    /// Joints whose gravity torque hardly varies, although it could.
    pub gravity: Vec<GravitySweep>,
    /// Sums of parameters that the model has.
    pub sums: usize,
    /// Combinations of them that the logs do not tell: names and weights.
    pub open: Vec<Vec<(String, f64)>>,
    /// The interval to be expected of each sum, from the torque that the declared model's best fit leaves, whose
    /// correlation from row to row counts.
    pub expected: Vec<Expected>,
    /// The run that would tell most.
    pub next: NextRun,
}

/// Two joints whose commands belong together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Collinear {
    pub joints: [Joint; 2],
    pub correlation: f64,
}

/// A joint that moves in one direction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OneWay {
    pub joint: Joint,
    /// The share of the path in the rarer direction.
    pub reverse: f64,
}

/// A joint whose weight is hardly varied.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GravitySweep {
    pub joint: Joint,
    /// Range of the gravity torque in the logs, N m (or N).
    pub swept: f64,
    /// Its range as this joint turns once about the pose in the middle of the logs.
    pub possible: f64,
}

/// A further run of ten seconds, about the ranges of the logs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NextRun {
    /// The joints that move.
    pub joints: Vec<Joint>,
    /// Whether they move at a quarter of the speeds of the logs.
    pub is_slow: bool,
    /// By how much it raises the logarithm of the information's determinant.
    pub gain: f64,
    /// The sum that it tells most beyond the logs, and by what factor its interval shrinks.
    pub narrows: (String, f64),
}

/// How well logs excite a model, at the values in its file.
///
/// # Errors
/// Logs that do not suit the model or are too short, and a model as in [`ExciteError`].
pub fn excitation(model: &Model, logs: &[Log]) -> Result<Excitation, ExciteError> {
    for log in logs {
        if log.joints() != model.joints {
            return Err(ExciteError::Log {
                log: log.name(),
                found: log.joints(),
                expected: model.joints,
            });
        }
    }
    let smooth: Vec<Smooth> = logs.iter().map(|log| smoothed(model, log)).collect();
    if smooth.iter().all(|log| log.time.is_empty()) {
        return Err(ExciteError::ShortLogs);
    }
    let limits = shown_limits(&smooth, model.joints);
    let series = Series::new(&limits.joints, RUN_S, RUN_HARMONICS);
    let mut rng = stream(0, Purpose::Other(0));
    let way = (series, log_determinant as Criterion);
    let problem = Problem::new(model, &[], &limits, RUN_S, way, &mut rng)?;
    let rows = rows(&problem, &smooth);
    let (problem, information) = weighed(problem, &rows);
    let base = problem.base.of(&information);
    Ok(Excitation {
        collinear: collinear(logs, model.joints),
        one_way: one_way(&smooth, model.joints),
        gravity: gravity(model, &smooth)?,
        sums: problem.base.columns.len(),
        open: open(&problem, &base),
        expected: expected(&problem.base, &base),
        next: next_run(&problem, &information, &limits),
    })
}

/// A log as fits of torques read it; torques are those that drives ask for.
fn smoothed(model: &Model, log: &Log) -> Smooth {
    let smooth = Smooth::by(&Smoothing::precise(log).thinned(), log, &[]);
    model.with_drive_torques(log, smooth)
}

/// Limits about what logs show, which leave room for a run that tells more.
fn shown_limits(smooth: &[Smooth], joints: usize) -> Limits {
    let of_joint = |joint: usize| {
        let all = |channel: fn(&Smooth) -> &Vec<Vec<f64>>| {
            smooth
                .iter()
                .flat_map(move |log| channel(log)[joint].iter().copied())
        };
        let least = all(|log| &log.q).fold(f64::INFINITY, f64::min);
        let most = all(|log| &log.q).fold(f64::NEG_INFINITY, f64::max);
        let largest =
            |channel: fn(&Smooth) -> &Vec<Vec<f64>>| all(channel).map(f64::abs).fold(0.0, f64::max);
        let (middle, half) = (
            (least + most) / 2.0,
            ((most - least) / 2.0).max(LEAST[0] / 2.0),
        );
        JointLimits {
            angle: [middle - half, middle + half],
            speed: largest(|log| &log.qd).max(LEAST[1]),
            acceleration: largest(|log| &log.qdd).max(LEAST[2]),
            torque: None,
            torque_rate: None,
            command: None,
            command_rate: None,
            start: None,
            torque_noise: 1.0,
            encoder_noise: 1.0,
        }
    };
    Limits {
        step_s: 0.02,
        joints: (0..joints).map(of_joint).collect(),
        spheres: Vec::new(),
        boxes: Vec::new(),
    }
}

/// All rows of all logs: the model along their motion, and the torque that acts beyond the model's (`[row * joints +
/// joint]`, zero where the joint rests).
struct Rows {
    along: Along,
    difference: Vec<f64>,
    /// Whether each joint moves there.
    counts: Vec<bool>,
}

fn rows(problem: &Problem, smooth: &[Smooth]) -> Rows {
    let n = problem.balance.joints;
    let mut motion: Motion = Default::default();
    let (mut times, mut logged, mut counts) = (Vec::new(), Vec::new(), Vec::new());
    for log in smooth {
        times.extend(&log.time);
        for row in 0..log.time.len() {
            for joint in 0..n {
                motion[0].push(log.q[joint][row]);
                motion[1].push(log.qd[joint][row]);
                motion[2].push(log.qdd[joint][row]);
                // Thinned rows show no jerk; it matters to delays alone.
                motion[3].push(0.0);
                logged.push(log.tau[joint][row]);
                counts.push(!log.rests[joint][row]);
            }
        }
    }
    let along = problem.balance.along(&times, &motion);
    let difference = logged
        .iter()
        .zip(&along.drive.torque)
        .map(|(tau, needed)| tau - needed);
    Rows {
        difference: difference.collect(),
        along,
        counts,
    }
}

/// The problem with the noise of each joint that the declared model's best fit leaves in the logs, and their information in
/// units of the parameters' magnitudes.
fn weighed(mut problem: Problem, rows: &Rows) -> (Problem, DMatrix<f64>) {
    let n = problem.balance.joints;
    let left = problem.left_by_fit(&rows.along, &rows.difference, &rows.counts);
    let of_joint =
        |joint: usize| -> Vec<f64> { left.iter().skip(joint).step_by(n).copied().collect() };
    let noise: Vec<f64> = (0..n).map(|joint| white_noise(&of_joint(joint))).collect();
    problem.weigh_by(&noise);
    let information = problem.information(&rows.along, &rows.counts);
    (problem, information)
}

/// The standard deviation of independent residuals that say as little as these, which may be correlated from row to row: an
/// autoregression of first order multiplies the variance of a mean by (1 + r) / (1 - r).
fn white_noise(left: &[f64]) -> f64 {
    let rows = left.len().max(1) as f64;
    let variance = left.iter().map(|value| value * value).sum::<f64>() / rows;
    let neighbours = left.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / rows;
    let correlation = match variance > 0.0 {
        true => (neighbours / variance).clamp(0.0, 0.99),
        false => 0.0,
    };
    let inflated = variance * (1.0 + correlation) / (1.0 - correlation);
    // A perfect log leaves rounding.
    inflated.sqrt().max(1e-9)
}

fn collinear(logs: &[Log], joints: usize) -> Vec<Collinear> {
    let channel = |joint: usize| -> Vec<f64> {
        let centred = logs.iter().flat_map(|log| {
            let tau = &log.tau[joint];
            let mean = tau.iter().sum::<f64>() / tau.len().max(1) as f64;
            tau.iter().map(move |value| value - mean)
        });
        centred.collect()
    };
    let channels: Vec<Vec<f64>> = (0..joints).map(channel).collect();
    let product = |a: usize, b: usize| -> f64 {
        channels[a]
            .iter()
            .zip(&channels[b])
            .map(|(a, b)| a * b)
            .sum()
    };
    let pairs = (0..joints).flat_map(|b| (0..b).map(move |a| (a, b)));
    pairs
        .map(|(a, b)| Collinear {
            joints: [Joint::at(a), Joint::at(b)],
            correlation: product(a, b) / (product(a, a) * product(b, b)).sqrt(),
        })
        .filter(|pair| pair.correlation.abs() > COLLINEAR)
        .collect()
}

fn one_way(smooth: &[Smooth], joints: usize) -> Vec<OneWay> {
    let path = |joint: usize, sign: f64| -> f64 {
        let speeds = smooth
            .iter()
            .flat_map(|log| log.qd[joint].iter().zip(&log.rests[joint]));
        let moving = speeds.filter(|(_, rests)| !**rests);
        moving.map(|(speed, _)| (sign * speed).max(0.0)).sum()
    };
    (0..joints)
        .filter_map(|joint| {
            let (up, down) = (path(joint, 1.0), path(joint, -1.0));
            let reverse = up.min(down) / (up + down);
            (reverse < RARE).then_some(OneWay {
                joint: Joint::at(joint),
                reverse,
            })
        })
        .collect()
}

/// The gravity torque of a pose: what it takes to rest there.
fn gravity(model: &Model, smooth: &[Smooth]) -> Result<Vec<GravitySweep>, ExciteError> {
    let n = model.joints;
    let frictionless = model.with_effects(Vec::new());
    let balance = Balance::new(&frictionless, &[], &[])?;
    let holding = |poses: Vec<f64>| -> Vec<f64> {
        let zeros = vec![0.0; poses.len()];
        let times = vec![0.0; poses.len() / n];
        let motion: Motion = [poses, zeros.clone(), zeros.clone(), zeros];
        balance.drive(&times, &motion).torque
    };
    let logged = smooth.iter().flat_map(|log| {
        (0..log.time.len()).flat_map(move |row| (0..n).map(move |joint| log.q[joint][row]))
    });
    let logged: Vec<f64> = logged.collect();
    let range = |torques: &[f64], joint: usize| {
        let own = || torques.iter().skip(joint).step_by(n).copied();
        own().fold(f64::NEG_INFINITY, f64::max) - own().fold(f64::INFINITY, f64::min)
    };
    let middle: Vec<f64> = (0..n)
        .map(|joint| {
            let own = || logged.iter().skip(joint).step_by(n).copied();
            (own().fold(f64::NEG_INFINITY, f64::max) + own().fold(f64::INFINITY, f64::min)) / 2.0
        })
        .collect();
    let swept = holding(logged.clone());
    let largest = |joint: usize| {
        let all = smooth.iter().flat_map(|log| &log.tau[joint]);
        all.map(|tau| tau.abs()).fold(0.0, f64::max)
    };
    let of_joint = |joint: usize| {
        let turned = (0..AROUND).flat_map(|k| {
            let mut pose = middle.clone();
            let turn = match model.prismatic[joint] {
                true => 1.0,
                false => std::f64::consts::TAU,
            };
            pose[joint] += turn * k as f64 / AROUND as f64;
            pose
        });
        GravitySweep {
            joint: Joint::at(joint),
            swept: range(&swept, joint),
            possible: range(&holding(turned.collect()), joint),
        }
    };
    Ok((0..n)
        .map(of_joint)
        .filter(|sweep| {
            let matters = sweep.possible > GRAVITY_MATTERS * largest(sweep.joint.index());
            matters && sweep.swept < SWEPT * sweep.possible
        })
        .collect())
}

/// The combinations of sums that are told too loosely.
fn open(problem: &Problem, information: &DMatrix<f64>) -> Vec<Vec<(String, f64)>> {
    let Some(eigen) = eigen(information.clone()) else {
        return Vec::new();
    };
    let name = |k: usize| problem.base.sums[k].parts[0].0.clone();
    let directions = eigen.eigenvectors.column_iter().zip(&eigen.eigenvalues);
    directions
        .filter(|(_, value)| !(**value > LOOSE.powi(-2)))
        .map(|(direction, _)| {
            let parts = direction
                .iter()
                .enumerate()
                .filter(|(_, weight)| weight.abs() > NAMED);
            parts.map(|(k, weight)| (name(k), *weight)).collect()
        })
        .collect()
}

/// The best of random runs in which one joint moves, or all, fast or slowly.
fn next_run(problem: &Problem, known: &DMatrix<f64>, limits: &Limits) -> NextRun {
    let n = limits.joints.len();
    let singles = (0..n).map(|joint| vec![joint]);
    let kinds: Vec<Vec<usize>> = match n {
        1 => vec![vec![0]],
        _ => singles.chain([(0..n).collect()]).collect(),
    };
    // What the logs leave entirely open counts as known to a thousand times its size, so that determinants exist.
    let regular = DMatrix::identity(problem.base.columns.len(), problem.base.columns.len()) * 1e-6;
    let before = problem.base.of(known) + &regular;
    let intervals = |information: &DMatrix<f64>| expected(&problem.base, information);
    let log_det = |information: &DMatrix<f64>| {
        let size = information.nrows() as f64;
        log_determinant(information).map_or(f64::NEG_INFINITY, |(mean, _)| -mean * size)
    };
    let mut best: Option<NextRun> = None;
    let rates = [(false, 1.0), (true, SLOWER)];
    for (kind, (is_slow, slower)) in kinds.iter().flat_map(|kind| rates.map(|rate| (kind, rate))) {
        for run in 0..RUNS {
            let mut rng = stream(0, Purpose::Other(1 + run));
            let random = problem.random_of(kind, &mut rng);
            // A run that takes longer has more rows, too: of the same ten seconds only a part is run through.
            let told = problem.information_slowed(&random, slower);
            let after = problem.base.of(&told) + &before;
            let gain = log_det(&after) - log_det(&before);
            if best.as_ref().is_some_and(|best| best.gain >= gain) {
                continue;
            }
            let both = intervals(&before).into_iter().zip(intervals(&after));
            let factors = both.map(|(before, after)| {
                let name = before.sum.parts[0].0.clone();
                (name, before.deviation / after.deviation)
            });
            let narrows = factors.max_by(|a, b| a.1.total_cmp(&b.1));
            best = Some(NextRun {
                joints: kind.iter().map(|joint| Joint::at(*joint)).collect(),
                is_slow,
                gain,
                narrows: narrows.unwrap_or_default(),
            });
        }
    }
    best.expect("there is at least one joint")
}
