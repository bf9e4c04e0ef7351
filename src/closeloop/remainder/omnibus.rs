use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::closeloop::fitted::Fitted;
use crate::closeloop::settings::RemainderSettings;
use crate::closeloop::study::Study;
use crate::data::statistics::{deviation, mean};
use crate::data::{Audit, Joint};
use crate::identify::Values;

/// Whether the residuals of a model are more than the sensors' noise, whatever shape they have.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Omnibus {
    /// Probability of residuals so smooth in time if they were noise.
    #[schemars(range(min = 0, max = 1))]
    pub p_value: f64,
    /// Windows that were tested: those in which the logger dropped no row, since torques that nobody knows move the rig
    /// too; where there is none, all.
    pub windows: usize,
    /// Share of the residuals' variance that white noise does not explain, one a joint.
    #[serde(rename = "share")]
    #[schemars(inner(range(min = 0, max = 1)))]
    pub shares: Vec<f64>,
    /// Share of the declared model's residual variance above noise that remains.
    #[serde(skip)]
    pub fraction: f64,
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

/// Compare, window by window, the share of the residuals' energy that is smooth in time with that of noise of the
/// sensor, rounded as the sensor rounds, passed through the same fit of start states. The share of a window
/// does not depend on how large the noise is, and one bad reading raises it no more than any noise does.
pub fn omnibus(study: &Study<'_>, before: &Fitted, after: &Fitted, rng: &mut impl Rng) -> Omnibus {
    let of_residuals = |windows: &[Window]| Energies::of(windows, |window| window.residual.clone());
    let chosen = chosen(study);
    let windows = windows(study, after, &chosen);
    let joints = study.declared.joints;
    let seeds: Vec<u64> = (0..study.settings.remainder.noise_draws)
        .map(|_| rng.random())
        .collect();
    let declared = of_residuals(&self::windows(study, before, &chosen));
    let found = of_residuals(&windows);
    let simulated: Vec<Energies> = seeds
        .into_par_iter()
        .map(|seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            Energies::of(&windows, |window| window.noise(&mut rng))
        })
        .collect();
    let nulls: Vec<NoiseShare> = (0..joints).map(|j| NoiseShare::of(&simulated, j)).collect();
    let excess = |energies: &Energies| {
        let each = (0..joints).map(|j| nulls[j].excess(energies.shares[j]));
        each.fold(f64::NEG_INFINITY, f64::max)
    };
    let bar = excess(&found);
    #[allow(clippy::cast_precision_loss)] // a thousand
    let as_smooth = simulated.iter().filter(|s| excess(s) >= bar).count() as f64;
    #[allow(clippy::cast_precision_loss)]
    let trials = simulated.len() as f64;
    let noise: Vec<f64> = (0..joints).map(|j| nulls[j].noise(&found, j)).collect();
    // In units of the sensors' noise, so that joints can be added.
    let above = |energies: &Energies| -> f64 {
        let of_joint = |j: usize| (energies.all[j] - noise[j]).max(0.0);
        (0..joints)
            .map(|j| of_joint(j) / study.shooting.noise[j].powi(2))
            .sum()
    };
    Omnibus {
        p_value: (1.0 + as_smooth) / (1.0 + trials),
        windows: chosen.len(),
        shares: (0..joints)
            .map(|j| (1.0 - noise[j] / found.all[j].max(f64::MIN_POSITIVE)).max(0.0))
            .collect(),
        fraction: (above(&found) / above(&declared).max(f64::MIN_POSITIVE)).min(1.0),
    }
}

/// The residual of one window, with the fit and the sensor there.
struct Window {
    joints: usize,
    /// In m or rad, `[row * joints + joint]`.
    residual: DVector<f64>,
    /// Basis of the residual's changes with the start state: orthonormal columns.
    absorbed: DMatrix<f64>,
    /// Smooth waves over the rows of the window: orthonormal columns.
    waves: DMatrix<f64>,
    /// The model's positions, for what rounding does to them.
    positions: DVector<f64>,
    /// Deviation of the noise before rounding and the step of the rounding (0 for none), one each a joint.
    sensor: Vec<[f64; 2]>,
}

/// The windows in which no row is missing or, where there is none, all.
fn chosen(study: &Study<'_>) -> Vec<usize> {
    let windows = &study.shooting.windows;
    let is_whole = |w: &usize| {
        let window = windows[*w];
        study.logs[window.log].is_whole(window.first..=window.last)
    };
    let all = 0..windows.len();
    let whole: Vec<usize> = all.clone().filter(is_whole).collect();
    if whole.is_empty() {
        all.collect()
    } else {
        whole
    }
}

fn windows(study: &Study<'_>, fitted: &Fitted, chosen: &[usize]) -> Vec<Window> {
    let RemainderSettings {
        slow_waves,
        start_step,
        ..
    } = study.settings.remainder;
    let joints = study.declared.joints;
    let shooting = &study.shooting;
    let dynamics = fitted.model.dynamics();
    let values = Values::of(&dynamics, study.logs);
    let residuals = |locals: &[Vec<f64>]| shooting.residuals(&dynamics, &values, locals);
    let sensors = sensors(study);
    let at = residuals(&fitted.fit.locals);
    let varied: Vec<Vec<Vec<f64>>> = (0..2 * joints)
        .map(|k| {
            let mut locals = fitted.fit.locals.clone();
            locals.iter_mut().for_each(|local| local[k] += start_step);
            residuals(&locals)
        })
        .collect();
    chosen
        .iter()
        .map(|&w| {
            let window = shooting.windows[w];
            let rows = window.rows();
            let size = rows * joints;
            let unit = |i: usize| shooting.noise[i % joints];
            let residual = DVector::from_fn(size, |i, _| at[w][i] * unit(i));
            let slopes = DMatrix::from_fn(size, varied.len(), |i, k| {
                (varied[k][w][i] - at[w][i]) * unit(i)
            });
            let log = &study.logs[window.log];
            let read = |i: usize| log.q[i % joints][window.first + i / joints];
            Window {
                joints,
                positions: DVector::from_fn(size, |i, _| read(i) + residual[i]),
                residual,
                absorbed: slopes.qr().q(),
                waves: waves(rows, slow_waves),
                sensor: sensors[window.log].clone(),
            }
        })
        .collect()
}

/// Noise before rounding, and step of the rounding, of each joint in each log.
fn sensors(study: &Study<'_>) -> Vec<Vec<[f64; 2]>> {
    let of_log = |audit: &Audit| {
        let joints = &audit.joints;
        let sensor = |j: usize| {
            let (step, seen) = (joints[j].q.resolution, joints[j].q.noise_std);
            let noise = (seen * seen - step * step / 12.0).max(0.0).sqrt();
            // Where the audit finds neither, any noise will do: shares do not depend on its size.
            [
                if step > 0.0 {
                    noise
                } else {
                    study.shooting.noise[j]
                },
                step,
            ]
        };
        (0..joints.len()).map(sensor).collect()
    };
    study.audits().iter().map(of_log).collect()
}

/// The slowest waves of the discrete cosine transform of so many rows, at most half of all.
fn waves(rows: usize, slow: usize) -> DMatrix<f64> {
    #[allow(clippy::cast_precision_loss)] // few rows
    let count = rows as f64;
    DMatrix::from_fn(rows, (slow + 1).min(rows / 2), |row, wave| {
        #[allow(clippy::cast_precision_loss)]
        let phase = PI * wave as f64 * (row as f64 + 0.5) / count;
        phase.cos() * ((if wave == 0 { 1.0 } else { 2.0 }) / count).sqrt()
    })
}

impl Window {
    /// A draw of the error that the sensor adds to the model's positions.
    fn noise(&self, rng: &mut impl Rng) -> DVector<f64> {
        // The zero's place within a step of the encoder is unknown.
        let phases: Vec<f64> = (0..self.joints).map(|_| rng.random()).collect();
        DVector::from_fn(self.positions.len(), |i, _| {
            let [noise, step] = self.sensor[i % self.joints];
            let added: f64 = StandardNormal.sample(rng);
            let read = self.positions[i] + noise * added;
            let shown = if step > 0.0 {
                let phase = phases[i % self.joints];
                ((read / step + phase).round() - phase) * step
            } else {
                read
            };
            shown - self.positions[i]
        })
    }

    /// Slow and total energy of what the fit of the start state leaves of `signal`, one each a joint.
    fn energies(&self, signal: &DVector<f64>) -> Vec<[f64; 2]> {
        let left = signal - &self.absorbed * (self.absorbed.tr_mul(signal));
        (0..self.joints)
            .map(|j| {
                let own = left.iter().skip(j).step_by(self.joints).copied();
                let own = DVector::from_vec(own.collect());
                [self.waves.tr_mul(&own).norm_squared(), own.norm_squared()]
            })
            .collect()
    }
}

/// Energies of one set of residuals, one a joint.
struct Energies {
    /// Mean over the windows of the share that is smooth.
    shares: Vec<f64>,
    /// Sums over the windows.
    smooth: Vec<f64>,
    all: Vec<f64>,
}

impl Energies {
    fn of(windows: &[Window], mut signal: impl FnMut(&Window) -> DVector<f64>) -> Self {
        let joints = windows.first().map_or(0, |window| window.joints);
        let mut sums = Self {
            shares: vec![0.0; joints],
            smooth: vec![0.0; joints],
            all: vec![0.0; joints],
        };
        #[allow(clippy::cast_precision_loss)] // few windows
        let count = windows.len() as f64;
        for window in windows {
            let energies = window.energies(&signal(window));
            for (j, [smooth, all]) in energies.into_iter().enumerate() {
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
    /// Of the energy summed over windows.
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

    /// In standard deviations.
    fn excess(&self, share: f64) -> f64 {
        (share - self.mean) / self.deviation.max(f64::MIN_POSITIVE)
    }

    /// Energy of white noise that is as strong as the fast waves of these residuals.
    fn noise(&self, energies: &Energies, joint: usize) -> f64 {
        let rough = energies.all[joint] - energies.smooth[joint];
        rough / (1.0 - self.pooled).max(f64::MIN_POSITIVE)
    }
}
