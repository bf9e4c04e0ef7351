use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;

use super::{Blocks, SegmentsError, Structure, TrainError};
use residyn_core::model::{Angles, InputScaling, LastLayer, MlpSettings, MlpWeights};
use residyn_io::files::content_id;

/// Segments of trajectories, k steps each: the training data. k = 1 gives transitions (s, a, s').
///
/// Numbers are f32. Sampling may be irregular, since every step has its own length.
#[derive(Debug, Clone, PartialEq)]
pub struct Segments {
    joints: usize,
    /// Number of states: positions, velocities, then internal states.
    width: usize,
    steps: usize,
    /// `[segment][k + 1][state]`
    states: Vec<f32>,
    /// `[segment][k][n]`, each held over its step.
    inputs: Vec<f32>,
    /// `[segment][k]`, s
    dt: Vec<f32>,
    /// `[segment]`, s
    start: Vec<f32>,
}

/// Segments as columns on a device.
#[derive(Debug, Clone)]
pub struct Columns {
    /// `[step][joint]`, each `[batch]`
    pub inputs: Vec<Vec<Tensor<1>>>,
    /// `[k + 1][state]`, each `[batch]`
    pub states: Vec<Vec<Tensor<1>>>,
    /// `[step]`, each `[batch]`, s
    pub dt: Vec<Tensor<1>>,
    /// `[step]`, each `[batch]`: when the step begins, s
    pub time: Vec<Tensor<1>>,
    /// Number of segments.
    pub size: usize,
}

impl Segments {
    /// An empty set for `joints` joints and `steps` steps each.
    ///
    /// # Panics
    /// When either is zero.
    pub fn new(joints: usize, steps: usize) -> Self {
        assert!(joints > 0 && steps > 0, "segments have joints and steps");
        Self {
            joints,
            width: 2 * joints,
            steps,
            states: Vec::new(),
            inputs: Vec::new(),
            dt: Vec::new(),
            start: Vec::new(),
        }
    }

    /// The same for models with this many internal states, whose values at each row are data as well.
    #[must_use]
    pub fn with_internal(self, internal: usize) -> Self {
        Self {
            width: 2 * self.joints + internal,
            ..self
        }
    }

    /// Cuts a trajectory into segments; a new one begins every `stride` rows.
    ///
    /// `time` has one number per row (s), `states` `2n` (positions, velocities) and the internal ones, `inputs` `n` (held
    /// until the next row; the last row's is not used).
    ///
    /// # Errors
    /// Lengths that disagree, numbers that are not finite, time that does not increase, too few rows. The segments then
    /// stay unchanged.
    ///
    /// # Panics
    /// When `stride` is zero.
    pub fn push_trajectory(
        &mut self,
        time: &[f64],
        states: &[f64],
        inputs: &[f64],
        stride: usize,
    ) -> Result<(), SegmentsError> {
        let (rows, n, width) = (time.len(), self.joints, self.width);
        self.check(time, states, inputs)?;
        if rows <= self.steps {
            return Err(SegmentsError::TooShort {
                rows,
                steps: self.steps,
            });
        }
        for first in (0..rows - self.steps).step_by(stride) {
            let last = first + self.steps;
            push(&mut self.states, &states[width * first..width * (last + 1)]);
            push(&mut self.inputs, &inputs[n * first..n * last]);
            let steps = time[first..=last].windows(2).map(|pair| pair[1] - pair[0]);
            push(&mut self.dt, &steps.collect::<Vec<_>>());
            push(&mut self.start, &time[first..=first]);
        }
        Ok(())
    }

    fn check(&self, time: &[f64], states: &[f64], inputs: &[f64]) -> Result<(), SegmentsError> {
        let (rows, n) = (time.len(), self.joints);
        let parts = [
            ("time", time, 1),
            ("states", states, self.width),
            ("inputs", inputs, n),
        ];
        for (what, numbers, width) in parts {
            if numbers.len() != rows * width {
                return Err(SegmentsError::Length {
                    what,
                    expected: rows * width,
                    found: numbers.len(),
                    rows,
                    joints: n,
                });
            }
            if let Some(k) = numbers.iter().position(|x| !x.is_finite()) {
                return Err(SegmentsError::NotFinite {
                    what,
                    row: k / width,
                    value: numbers[k],
                });
            }
        }
        match time.windows(2).position(|pair| pair[1] <= pair[0]) {
            Some(row) => Err(SegmentsError::Time {
                row: row + 1,
                before: time[row],
                after: time[row + 1],
            }),
            None => Ok(()),
        }
    }

    /// Number of segments.
    pub fn len(&self) -> usize {
        self.start.len()
    }

    pub fn is_empty(&self) -> bool {
        self.start.is_empty()
    }

    /// Checks that a model of this structure can be fitted to them; `role` is their use, for the message.
    ///
    /// # Errors
    /// No segments, or another number of joints.
    pub(super) fn check_for(
        &self,
        structure: &Structure,
        role: &'static str,
    ) -> Result<(), TrainError> {
        if self.is_empty() {
            return Err(SegmentsError::Empty.into());
        }
        if self.joints != structure.joints {
            return Err(TrainError::Joints {
                role,
                system: structure.system.clone(),
                expected: structure.joints,
                found: self.joints,
            });
        }
        if self.width != structure.states() {
            return Err(TrainError::InternalStates {
                role,
                system: structure.system.clone(),
                expected: structure.states() - 2 * structure.joints,
                found: self.width - 2 * self.joints,
            });
        }
        Ok(())
    }

    /// A hash of all numbers.
    pub fn fingerprint(&self) -> String {
        let numbers = [&self.states, &self.inputs, &self.dt, &self.start];
        let numbers = numbers.into_iter().flatten().map(|x| x.to_bits());
        #[allow(clippy::cast_possible_truncation)] // few joints and steps
        let shape = [self.joints as u32, self.steps as u32];
        #[allow(clippy::cast_possible_truncation)] // few states
        let internal = (self.width > 2 * self.joints).then_some(self.width as u32);
        let shape = shape.into_iter().chain(internal);
        let bytes = shape.chain(numbers).flat_map(u32::to_le_bytes);
        content_id(&bytes.collect::<Vec<u8>>())
    }

    /// Positions, velocities and inputs at each step.
    pub fn rows(&self) -> impl Iterator<Item = [Vec<f64>; 3]> + Clone {
        let n = self.joints;
        (0..self.len() * self.steps).map(move |k| {
            let (segment, step) = (k / self.steps, k % self.steps);
            let state = self.width * (segment * (self.steps + 1) + step);
            let wide = |numbers: &[f32]| numbers.iter().copied().map(f64::from).collect();
            [
                wide(&self.states[state..state + n]),
                wide(&self.states[state + n..state + 2 * n]),
                wide(&self.inputs[n * k..n * (k + 1)]),
            ]
        })
    }

    /// Mean and standard deviation of a network's features over all steps.
    pub fn scaling(&self, angles: Angles) -> InputScaling {
        let rows = self.rows().map(|[q, qd, tau]| angles.row(&q, &qd, &tau));
        InputScaling::from_rows(angles.features(self.joints), rows)
    }

    /// A new network for models of this motion, with features scaled to it.
    pub fn network(
        &self,
        settings: &MlpSettings,
        last: LastLayer,
        rng: &mut impl Rng,
    ) -> MlpWeights {
        let scaling = self.scaling(settings.angles);
        MlpWeights::new(self.joints, settings, scaling, last, rng)
    }

    /// The chosen segments for the fused loss.
    pub(super) fn blocks(&self, chosen: &[usize]) -> Blocks {
        let (n, width, k) = (self.joints, self.width, self.steps);
        Blocks::new([n, width], k, chosen.len(), |row| {
            let segment = chosen[row];
            let states = &self.states[width * segment * (k + 1)..][..width * (k + 1)];
            let inputs = &self.inputs[n * k * segment..][..n * k];
            let mut time = self.start[segment];
            let mut values = Vec::new();
            for step in 0..k {
                let dt = self.dt[segment * k + step];
                values.extend_from_slice(&states[width * step..][..width]);
                values.extend_from_slice(&inputs[n * step..][..n]);
                values.extend([dt, time]);
                time += dt;
            }
            values.extend_from_slice(&states[width * k..]);
            values
        })
    }

    /// The chosen segments for the composed loss on a device.
    pub(super) fn columns(&self, chosen: &[usize], device: &Device) -> Columns {
        let (n, k) = (self.joints, self.steps);
        let column = |from: &[f32], width: usize, offset: usize| {
            let values: Vec<f32> = chosen.iter().map(|i| from[i * width + offset]).collect();
            Tensor::<1>::from_data(TensorData::new(values, [chosen.len()]), device)
        };
        let group = |from: &[f32], rows: usize, width: usize| {
            let at = |offset| column(from, rows * width, offset);
            let row = |row| (row * width..(row + 1) * width).map(at).collect();
            (0..rows).map(row).collect()
        };
        let dt: Vec<Tensor<1>> = (0..k).map(|step| column(&self.dt, k, step)).collect();
        let mut time = vec![column(&self.start, 1, 0)];
        for step in 1..k {
            time.push(time[step - 1].clone() + dt[step - 1].clone());
        }
        Columns {
            inputs: group(&self.inputs, k, n),
            states: group(&self.states, k + 1, self.width),
            dt,
            time,
            size: chosen.len(),
        }
    }
}

#[allow(clippy::cast_possible_truncation)] // training runs in f32
fn push(to: &mut Vec<f32>, from: &[f64]) {
    to.extend(from.iter().map(|x| *x as f32));
}

#[cfg(test)]
mod tests {
    use super::{Segments, SegmentsError};
    use crate::Backend;

    #[test]
    fn a_trajectory_is_cut_into_overlapping_segments() {
        let time = [0.0, 0.5, 0.75, 1.0];
        let states: Vec<f64> = (0..8).map(f64::from).collect();
        let mut segments = Segments::new(1, 2);
        segments
            .push_trajectory(&time, &states, &[10.0, 11.0, 12.0, 13.0], 1)
            .unwrap();
        assert_eq!(segments.len(), 2);
        let batch = segments.columns(&[0, 1], &Backend::NdArray.device());
        let numbers = |t: &burn::tensor::Tensor<1>| t.to_data().iter::<f32>().collect::<Vec<_>>();
        assert_eq!(numbers(&batch.states[0][1]), [1.0, 3.0]);
        assert_eq!(numbers(&batch.states[2][0]), [4.0, 6.0]);
        assert_eq!(numbers(&batch.inputs[1][0]), [11.0, 12.0]);
        assert_eq!(numbers(&batch.dt[0]), [0.5, 0.25]);
        assert_eq!(numbers(&batch.time[1]), [0.5, 0.75]);
    }

    #[test]
    fn bad_rows_are_refused_with_their_place() {
        let mut segments = Segments::new(1, 1);
        let refused = |s: &mut Segments, time: &[f64], states: &[f64]| {
            s.push_trajectory(time, states, &vec![0.0; time.len()], 1)
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            refused(&mut segments, &[0.0, 0.1], &[0.0, 0.0, f64::NAN, 0.0]),
            "states of row 1 is NaN; leave such rows out before training"
        );
        assert_eq!(
            refused(&mut segments, &[0.0, 0.0], &[0.0; 4]),
            "time goes from 0 s to 0 s at row 1; it must increase"
        );
        assert_eq!(
            refused(&mut segments, &[0.0, 0.1], &[0.0; 3]),
            "states has 3 numbers, 4 are needed for 2 rows and 1 joints"
        );
        assert_eq!(
            segments.push_trajectory(&[0.0], &[0.0; 2], &[0.0], 1),
            Err(SegmentsError::TooShort { rows: 1, steps: 1 })
        );
        assert!(segments.is_empty());
    }
}
