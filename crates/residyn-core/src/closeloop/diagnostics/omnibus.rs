use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::torque_noise::TorqueNoise;
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::data::statistics::{deviation, mean};
use crate::data::{Audit, Joint};
use crate::identify::Values;

/// Whether the residuals of a model are more than the sensors' noise, whatever shape they have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Omnibus {
    /// Probability of residuals this smooth in time if they were noise.
    #[schemars(range(min = 0, max = 1))]
    pub p_value: f64,
    /// Number of windows tested: those in which the logger dropped no row, since unrecorded torques move the rig too,
    /// or all if there are none.
    pub windows: usize,
    /// Share of the residuals' variance that white noise does not explain, one a joint.
    #[serde(rename = "share")]
    #[schemars(inner(range(min = 0, max = 1)))]
    pub shares: Vec<f64>,
    /// Share of the declared model's residual variance above noise that remains.
    #[serde(skip)]
    pub fraction: f64,
    /// As `fraction`, one a joint.
    #[serde(skip)]
    pub fractions: Vec<f64>,
}

impl Omnibus {
    /// The joint with the largest share, and that share.
    pub fn most(&self) -> (Joint, f64) {
        let shares = Joint::all(self.shares.len()).zip(self.shares.iter().copied());
        shares
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((Joint::at(0), 0.0))
    }
}

/// Compare, window by window, the share of the residuals' energy that is smooth in time with that of sensor noise
/// processed as the residuals were. The share of a window does not depend on the size of the noise, and one bad reading
/// raises it no more than any noise does.
pub fn omnibus(
    problem: &Problem<'_>,
    before: &Fitted,
    after: &Fitted,
    rng: &mut impl Rng,
) -> Omnibus {
    let chosen = chosen(problem);
    let settings = &problem.settings.diagnostics;
    match problem.error_model {
        ErrorModel::OutputError => {
            let [declared, found] = [before, after].map(|fitted| windows(problem, fitted, &chosen));
            let residuals = |windows: &[Window]| -> Vec<DVector<f64>> {
                windows.iter().map(|w| w.left(&w.residual)).collect()
            };
            let test = Test::new(problem, &residuals(&declared), &residuals(&found));
            test.against(settings.noise_draws, rng, |rng| {
                found.iter().map(|w| w.left(&w.noise(rng))).collect()
            })
        }
        ErrorModel::InverseDynamics => {
            let [declared, found] =
                [before, after].map(|fitted| TorqueNoise::new(problem, &fitted.model, &chosen));
            let test = Test::new(problem, declared.residuals(), found.residuals());
            test.against(settings.torque_noise_draws, rng, |rng| found.draw(rng))
        }
    }
}

/// The energies of two models' residuals, to be compared with that of noise.
struct Test {
    /// Noise of the sensors, or of the torques, one a joint.
    noise: Vec<f64>,
    /// Smooth waves over the rows of each window: orthonormal columns.
    waves: Vec<DMatrix<f64>>,
    declared: Energies,
    found: Energies,
}

impl Test {
    /// From residuals of the declared model and of a model with effects, `[row * joints + joint]`, over the same
    /// windows.
    fn new(problem: &Problem<'_>, declared: &[DVector<f64>], found: &[DVector<f64>]) -> Self {
        let slow = problem.settings.diagnostics.slow_waves;
        let joints = problem.declared.joints;
        let of_window = |residual: &DVector<f64>| waves(residual.len() / joints, slow);
        let waves: Vec<DMatrix<f64>> = found.iter().map(of_window).collect();
        Self {
            noise: problem.shooting.noise.clone(),
            declared: Energies::of(joints, declared, &waves),
            found: Energies::of(joints, found, &waves),
            waves,
        }
    }

    /// `draw` gives the residuals that noise alone would leave in the windows.
    fn against(
        &self,
        draws: usize,
        rng: &mut impl Rng,
        draw: impl Fn(&mut ChaCha8Rng) -> Vec<DVector<f64>> + Sync,
    ) -> Omnibus {
        let joints = self.noise.len();
        let seeds: Vec<u64> = (0..draws).map(|_| rng.random()).collect();
        let simulated: Vec<Energies> = seeds
            .into_par_iter()
            .map(|seed| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                Energies::of(joints, &draw(&mut rng), &self.waves)
            })
            .collect();
        let nulls: Vec<NoiseShare> = (0..joints).map(|j| NoiseShare::of(&simulated, j)).collect();
        let excess = |energies: &Energies| {
            let each = (0..joints).map(|j| nulls[j].excess(energies.shares[j]));
            each.fold(f64::NEG_INFINITY, f64::max)
        };
        let found = &self.found;
        let bar = excess(found);
        let as_smooth = simulated.iter().filter(|s| excess(s) >= bar).count() as f64;
        let trials = simulated.len() as f64;
        let noise: Vec<f64> = (0..joints).map(|j| nulls[j].noise(found, j)).collect();
        // In units of the noise, so that joints can be added.
        let above = |energies: &Energies| -> Vec<f64> {
            let of_joint = |j: usize| (energies.all[j] - noise[j]).max(0.0) / self.noise[j].powi(2);
            (0..joints).map(of_joint).collect()
        };
        let [left, declared] = [found, &self.declared].map(above);
        let share = |left: f64, declared: f64| (left / declared.max(f64::MIN_POSITIVE)).min(1.0);
        Omnibus {
            p_value: (1.0 + as_smooth) / (1.0 + trials),
            windows: self.waves.len(),
            shares: (0..joints)
                .map(|j| (1.0 - noise[j] / found.all[j].max(f64::MIN_POSITIVE)).max(0.0))
                .collect(),
            fraction: share(left.iter().sum(), declared.iter().sum()),
            fractions: (0..joints).map(|j| share(left[j], declared[j])).collect(),
        }
    }
}

/// The residual of one window, with its fit and sensor.
struct Window {
    /// Joints in the order in which noise is drawn.
    joints: Vec<usize>,
    /// In m or rad, `[row * joints + joint]`.
    residual: DVector<f64>,
    /// Basis of the residual's change with the start state: orthonormal columns.
    absorbed: DMatrix<f64>,
    /// The model's positions, to which rounding is applied.
    positions: DVector<f64>,
    /// Standard deviation of the noise before rounding and rounding step (0 for none), one pair a joint.
    sensor: Vec<[f64; 2]>,
}

/// The windows in which no row is missing, or all if there are none.
fn chosen(problem: &Problem<'_>) -> Vec<usize> {
    let windows = &problem.shooting.windows;
    let is_whole = |w: &usize| {
        let window = windows[*w];
        problem.logs[window.log].is_whole(window.first..=window.last)
    };
    let all = 0..windows.len();
    let whole: Vec<usize> = all.clone().filter(is_whole).collect();
    if whole.is_empty() {
        all.collect()
    } else {
        whole
    }
}

fn windows(problem: &Problem<'_>, fitted: &Fitted, chosen: &[usize]) -> Vec<Window> {
    let start_step = problem.settings.diagnostics.start_step;
    let joints = problem.declared.joints;
    let shooting = &problem.shooting;
    let dynamics = fitted.model.dynamics();
    let values = Values::of(&dynamics, problem.logs);
    let residuals =
        |start_states: &[Vec<f64>]| shooting.residuals(&dynamics, &values, start_states);
    let sensors = sensors(problem);
    let order = problem.joints_by_motion();
    let at = residuals(&fitted.fit.start_states);
    let vary = |k: usize| {
        let mut start_states = fitted.fit.start_states.clone();
        for local in &mut start_states {
            local[k] += start_step;
        }
        residuals(&start_states)
    };
    let varied: Vec<Vec<Vec<f64>>> = (0..2 * joints).map(vary).collect();
    (chosen.iter())
        .map(|&w| {
            let window = shooting.windows[w];
            let rows = window.rows();
            let size = rows * joints;
            let unit = |i: usize| shooting.noise[i % joints];
            let residual = DVector::from_fn(size, |i, _| at[w][i] * unit(i));
            let slopes = DMatrix::from_fn(size, varied.len(), |i, k| {
                (varied[k][w][i] - at[w][i]) * unit(i)
            });
            let log = &problem.logs[window.log];
            let read = |i: usize| log.q[i % joints][window.first + i / joints];
            Window {
                joints: order.clone(),
                positions: DVector::from_fn(size, |i, _| read(i) + residual[i]),
                residual,
                absorbed: slopes.qr().q(),
                sensor: sensors[window.log].clone(),
            }
        })
        .collect()
}

/// Noise before rounding, and rounding step, of each joint in each log.
fn sensors(problem: &Problem<'_>) -> Vec<Vec<[f64; 2]>> {
    let of_log = |audit: &Audit| {
        let joints = &audit.joints;
        let sensor = |j: usize| {
            let (step, seen) = (joints[j].q.resolution, joints[j].q.noise_std);
            let noise = (seen * seen - step * step / 12.0).max(0.0).sqrt();
            // If the audit finds neither, any noise will do: shares do not depend on its size.
            match step > 0.0 {
                true => [noise, step],
                false => [problem.shooting.noise[j], step],
            }
        };
        (0..joints.len()).map(sensor).collect()
    };
    problem.audits().iter().map(of_log).collect()
}

/// The slowest waves of the discrete cosine transform over the rows, at most half of all.
fn waves(rows: usize, slow: usize) -> DMatrix<f64> {
    let count = rows as f64;
    DMatrix::from_fn(rows, (slow + 1).min(rows / 2), |row, wave| {
        let phase = PI * wave as f64 * (row as f64 + 0.5) / count;
        phase.cos() * ((if wave == 0 { 1.0 } else { 2.0 }) / count).sqrt()
    })
}

impl Window {
    /// A draw of the error that the sensor adds to the model's positions.
    fn noise(&self, rng: &mut impl Rng) -> DVector<f64> {
        let mut all = DVector::zeros(self.positions.len());
        let count = self.joints.len();
        for &j in &self.joints {
            let [noise, step] = self.sensor[j];
            // The position of the zero within an encoder step is unknown.
            let phase: f64 = rng.random();
            for i in (j..all.len()).step_by(count) {
                let added: f64 = StandardNormal.sample(rng);
                let read = self.positions[i] + noise * added;
                let shown = if step > 0.0 {
                    ((read / step + phase).round() - phase) * step
                } else {
                    read
                };
                all[i] = shown - self.positions[i];
            }
        }
        all
    }

    /// The part of `signal` that the fit of the start state leaves.
    fn left(&self, signal: &DVector<f64>) -> DVector<f64> {
        signal - &self.absorbed * (self.absorbed.tr_mul(signal))
    }
}

/// Energies of one set of residuals, one a joint.
struct Energies {
    /// Mean of the smooth share over the windows.
    shares: Vec<f64>,
    /// Energies summed over the windows.
    smooth: Vec<f64>,
    all: Vec<f64>,
}

impl Energies {
    fn of(joints: usize, windows: &[DVector<f64>], waves: &[DMatrix<f64>]) -> Self {
        let mut sums = Self {
            shares: vec![0.0; joints],
            smooth: vec![0.0; joints],
            all: vec![0.0; joints],
        };
        let count = windows.len() as f64;
        for (window, waves) in windows.iter().zip(waves) {
            for j in 0..joints {
                let own = window.iter().skip(j).step_by(joints).copied();
                let own = DVector::from_vec(own.collect());
                let (smooth, all) = (waves.tr_mul(&own).norm_squared(), own.norm_squared());
                sums.shares[j] += smooth / all.max(f64::MIN_POSITIVE) / count;
                sums.smooth[j] += smooth;
                sums.all[j] += all;
            }
        }
        sums
    }
}

/// The smooth share of a joint's residuals under noise alone.
struct NoiseShare {
    mean: f64,
    deviation: f64,
    /// The smooth share of the energy summed over windows.
    pooled: f64,
}

impl NoiseShare {
    fn of(simulated: &[Energies], joint: usize) -> Self {
        let shares = simulated.iter().map(|energies| energies.shares[joint]);
        let shares: Vec<f64> = shares.collect();
        let sum = |part: fn(&Energies) -> &[f64]| -> f64 {
            simulated.iter().map(|energies| part(energies)[joint]).sum()
        };
        let all = sum(|energies| &energies.all);
        Self {
            mean: mean(&shares),
            deviation: deviation(&shares),
            pooled: sum(|energies| &energies.smooth) / all.max(f64::MIN_POSITIVE),
        }
    }

    /// Excess over the mean, in standard deviations.
    fn excess(&self, share: f64) -> f64 {
        (share - self.mean) / self.deviation.max(f64::MIN_POSITIVE)
    }

    /// Energy of white noise as strong as the fast waves of these residuals.
    fn noise(&self, energies: &Energies, joint: usize) -> f64 {
        let rough = energies.all[joint] - energies.smooth[joint];
        rough / (1.0 - self.pooled).max(f64::MIN_POSITIVE)
    }
}
