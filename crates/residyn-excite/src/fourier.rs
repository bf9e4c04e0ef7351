//! Motions that are Fourier series of one period, at rest at both ends: position, speed and acceleration of the sines and
//! cosines are combined so that they vanish at the period's ends (Swevers, Ganseman, Tukel, De Schutter and Van Brussel,
//! Optimal robot excitation and identification, 1997, with the conditions at the ends).

use std::f64::consts::TAU;

use nalgebra::DVector;

use crate::limits::JointLimits;

/// Position, speed, acceleration and jerk.
pub const DERIVATIVES: usize = 4;

/// The functions of which the joints' motions are sums.
#[derive(Debug, Clone)]
pub struct Series {
    /// Periods in the duration, in ascending order.
    pub harmonics: Vec<usize>,
    /// s
    pub duration_s: f64,
    /// `[joint][harmonic]`: the amplitude that a coefficient of one stands for, rad or m.
    sizes: Vec<Vec<f64>>,
}

/// The functions at some times: `[derivative][row * functions + function]`, before the joints' sizes.
#[derive(Debug, Clone)]
pub struct Grid {
    /// s
    pub times: Vec<f64>,
    /// Sines of all harmonics, then cosines.
    functions: [Vec<f64>; DERIVATIVES],
}

/// The motion of all joints: `[derivative][row * joints + joint]`.
pub type Motion = [Vec<f64>; DERIVATIVES];

/// Above this frequency a joint would have to pass its whole range within its limits many times over, and low passes of fits
/// take the torque away, Hz.
const HIGHEST_HZ: f64 = 5.0;

impl Series {
    /// At most `count` harmonics from one period in the duration up to the frequency at which a joint reaches its largest
    /// acceleration and its largest speed together, evenly spaced on a logarithmic scale.
    pub fn new(joints: &[JointLimits], duration_s: f64, count: usize) -> Self {
        let turning = |joint: &JointLimits| joint.acceleration / joint.speed / TAU;
        let top_hz = joints
            .iter()
            .map(turning)
            .fold(0.0, f64::max)
            .min(HIGHEST_HZ);
        let top = (top_hz * duration_s).ceil().max(3.0);
        let count = count.max(3);
        let place = |k: usize| top.powf(k as f64 / (count - 1) as f64);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // a small positive number
        let mut harmonics: Vec<usize> = (0..count).map(|k| place(k).round() as usize).collect();
        // Low harmonics that rounding makes equal move up, so that none is lost.
        for k in 1..count {
            harmonics[k] = harmonics[k].max(harmonics[k - 1] + 1);
        }
        let least = harmonics
            .iter()
            .position(|h| *h as f64 > top.max(count as f64));
        harmonics.truncate(least.unwrap_or(count));
        Self::of(joints, duration_s, harmonics)
    }

    /// With these harmonics.
    pub fn of(joints: &[JointLimits], duration_s: f64, harmonics: Vec<usize>) -> Self {
        let size = |joint: &JointLimits, harmonic: usize| {
            let omega = TAU * harmonic as f64 / duration_s;
            let range = (joint.angle[1] - joint.angle[0]) / 2.0;
            let fast = joint.speed / omega;
            range.min(fast).min(joint.acceleration / omega.powi(2))
        };
        let sizes = joints.iter().map(|joint| {
            let own = harmonics.iter().map(|harmonic| size(joint, *harmonic));
            own.collect()
        });
        Self {
            sizes: sizes.collect(),
            harmonics,
            duration_s,
        }
    }

    /// Number of functions of one joint.
    pub fn functions(&self) -> usize {
        2 * self.harmonics.len()
    }

    /// Number of coefficients: the start of each joint, then the functions of each joint.
    pub fn coefficients(&self) -> usize {
        self.sizes.len() * (1 + self.functions())
    }

    fn omega(&self, k: usize) -> f64 {
        TAU * self.harmonics[k] as f64 / self.duration_s
    }

    /// The highest angular frequency, rad/s.
    pub fn highest(&self) -> f64 {
        self.omega(self.harmonics.len() - 1)
    }

    /// The functions at these times.
    pub fn grid(&self, times: Vec<f64>) -> Grid {
        let count = self.harmonics.len();
        let mut functions: [Vec<f64>; DERIVATIVES] = Default::default();
        for &time in &times {
            for (derivative, all) in functions.iter_mut().enumerate() {
                let omegas = (0..count).map(|k| self.omega(k));
                let sines = omegas.clone().map(|omega| {
                    let (sin, cos) = (omega * time).sin_cos();
                    omega.powi(derivative as i32) * [sin, cos, -sin, -cos][derivative]
                });
                let cosines = omegas.map(|omega| {
                    let (sin, cos) = (omega * time).sin_cos();
                    let rest = if derivative == 0 { 1.0 } else { 0.0 };
                    omega.powi(derivative as i32) * [cos, -sin, -cos, sin][derivative] - rest
                });
                all.extend(sines.chain(cosines));
            }
        }
        Grid { times, functions }
    }

    /// `rows` times from the start to the end, both included.
    pub fn even_grid(&self, rows: usize) -> Grid {
        let step = self.duration_s / (rows - 1) as f64;
        self.grid((0..rows).map(|row| row as f64 * step).collect())
    }

    /// The amplitudes of a joint's functions: its coefficients, without the part that would move it at the ends. The sines'
    /// speeds sum to zero there, and so do the cosines' accelerations.
    fn amplitudes(&self, joint: usize, own: &[f64]) -> DVector<f64> {
        let count = self.harmonics.len();
        let sized = |f: usize| own[f] * self.sizes[joint][f % count];
        self.at_rest(joint, DVector::from_fn(2 * count, |f, _| sized(f)))
    }

    /// Remove that part. Lengths are measured in the joint's sizes, so that the removed part is spread over the harmonics as
    /// they can move.
    fn at_rest(&self, joint: usize, mut amplitudes: DVector<f64>) -> DVector<f64> {
        let count = self.harmonics.len();
        for (first, power) in [(0, 1), (count, 2)] {
            let (mut sum, mut norm) = (0.0, 0.0);
            for k in 0..count {
                let pull = self.omega(k).powi(power);
                sum += pull * amplitudes[first + k];
                norm += (pull * self.sizes[joint][k]).powi(2);
            }
            for k in 0..count {
                let pull = self.omega(k).powi(power);
                amplitudes[first + k] -= sum / norm * pull * self.sizes[joint][k].powi(2);
            }
        }
        amplitudes
    }

    /// The motion on a grid.
    pub fn motion(&self, grid: &Grid, coefficients: &[f64]) -> Motion {
        let (joints, functions) = (self.sizes.len(), self.functions());
        let (starts, rest) = coefficients.split_at(joints);
        let amplitudes: Vec<DVector<f64>> = (rest.chunks_exact(functions).enumerate())
            .map(|(joint, own)| self.amplitudes(joint, own))
            .collect();
        std::array::from_fn(|derivative| {
            let rows = grid.functions[derivative].chunks_exact(functions);
            rows.flat_map(|row| {
                amplitudes.iter().zip(starts).map(move |(own, start)| {
                    let sum: f64 = row.iter().zip(own.iter()).map(|(f, a)| f * a).sum();
                    if derivative == 0 { start + sum } else { sum }
                })
            })
            .collect()
        })
    }

    /// The gradient with respect to the coefficients of what has this gradient with respect to the motion on a grid.
    pub fn pull_back(&self, grid: &Grid, by_motion: &Motion) -> Vec<f64> {
        let (joints, functions) = (self.sizes.len(), self.functions());
        let count = self.harmonics.len();
        let mut gradient = vec![0.0; self.coefficients()];
        for joint in 0..joints {
            let mut by_amplitude = DVector::<f64>::zeros(functions);
            for derivative in 0..DERIVATIVES {
                let rows = grid.functions[derivative].chunks_exact(functions);
                let own = by_motion[derivative].chunks_exact(joints);
                for (row, own) in rows.zip(own) {
                    for (sum, f) in by_amplitude.iter_mut().zip(row) {
                        *sum += f * own[joint];
                    }
                }
            }
            gradient[joint] = by_motion[0].iter().skip(joint).step_by(joints).sum();
            let size = |f: usize| self.sizes[joint][f % count];
            // In units of the sizes the removal is an orthogonal projection, which is its own transpose.
            let scaled = DVector::from_fn(functions, |f, _| by_amplitude[f] * size(f).powi(2));
            let projected = self.at_rest(joint, scaled);
            let own = &mut gradient[joints + functions * joint..][..functions];
            for (f, value) in own.iter_mut().enumerate() {
                *value = projected[f] / size(f);
            }
        }
        gradient
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use rand::RngExt;
    use residyn_core::rng;

    use super::Series;
    use crate::limits::JointLimits;

    pub fn joint() -> JointLimits {
        JointLimits {
            angle: [-1.5, 2.0],
            speed: 2.0,
            acceleration: 12.0,
            torque: Some(10.0),
            torque_rate: None,
            command: None,
            command_rate: None,
            start: None,
            torque_noise: 0.1,
            encoder_noise: 1e-4,
        }
    }

    #[test]
    fn a_motion_is_at_rest_at_both_ends() {
        let series = Series::new(&[joint(), joint()], 8.0, 7);
        let mut rng = rng(3);
        let coefficients: Vec<f64> = (0..series.coefficients())
            .map(|_| rng.random_range(-1.0..1.0))
            .collect();
        let [q, qd, qdd, _] = series.motion(&series.even_grid(101), &coefficients);
        for joint in 0..2 {
            for row in [0, 100] {
                assert!((q[2 * row + joint] - coefficients[joint]).abs() < 1e-9);
                assert!(qd[2 * row + joint].abs() < 1e-9 && qdd[2 * row + joint].abs() < 1e-8);
            }
            assert!(qd[2 * 30 + joint].abs() > 1e-3);
        }
    }

    #[test]
    fn harmonics_are_whole_and_differ() {
        for duration_s in [0.5, 3.0, 10.0, 60.0] {
            let series = Series::new(&[joint()], duration_s, 9);
            assert_eq!(series.harmonics[0], 1);
            assert!(series.harmonics.is_sorted_by(|a, b| a < b) && series.harmonics.len() > 2);
        }
    }

    #[test]
    fn gradients_are_those_of_differences() {
        let series = Series::new(&[joint()], 4.0, 5);
        let grid = series.even_grid(33);
        let mut rng = rng(4);
        let x: Vec<f64> = (0..series.coefficients())
            .map(|_| rng.random_range(-1.0..1.0))
            .collect();
        let value = |x: &[f64]| -> f64 {
            let motion = series.motion(&grid, x);
            motion.iter().flatten().map(|value| value.sin()).sum()
        };
        let by_motion = series
            .motion(&grid, &x)
            .map(|all| all.iter().map(|value| value.cos()).collect());
        let gradient = series.pull_back(&grid, &by_motion);
        for k in 0..x.len() {
            let shifted = |by: f64| {
                let mut x = x.clone();
                x[k] += by;
                value(&x)
            };
            let expected = (shifted(1e-6) - shifted(-1e-6)) / 2e-6;
            assert!(
                (gradient[k] - expected).abs() < 1e-5 * (1.0 + expected.abs()),
                "{k}"
            );
        }
    }
}
