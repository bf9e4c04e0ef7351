//! Means of residuals and regressors over the wide window: the test function of the weak form.
//!
//! The equations are evaluated on a lightly smoothed motion, whose noise is large, and averaged after that: forces that are
//! not linear in the motion are averaged themselves, and not replaced by the forces of the average motion.

use super::kernel::Kernel;

/// One for each joint.
pub(crate) struct Averages {
    pub of_joint: Vec<Average>,
}

/// The latest rows of a joint: its residual and regressors.
pub(crate) struct Average {
    weights: Vec<f64>,
    /// Rows from one mean to the next.
    stride: usize,
    width: usize,
    rows: Vec<f64>,
    /// The direction in which the joint moves at each row, 0 for a rest.
    along: Vec<f64>,
    until_mean: usize,
    mean: Vec<f64>,
}

/// What a row adds.
pub(crate) enum Averaged<'a> {
    /// Nothing yet.
    Nothing,
    /// The joint did not move one way all along.
    Interrupted,
    Mean(&'a [f64]),
}

impl Averages {
    /// Over a half width of time, of rows that are a step apart (s); `widths` are the numbers in a row of each joint.
    pub fn new(half_width_s: f64, step_s: f64, widths: impl Iterator<Item = usize>) -> Self {
        let kernel = Kernel::new(half_width_s, step_s);
        let average = |width: usize| Average {
            weights: kernel.value.clone(),
            stride: (kernel.half / 2).max(1),
            width,
            rows: Vec::new(),
            along: Vec::new(),
            until_mean: 0,
            mean: vec![0.0; width],
        };
        Self {
            of_joint: widths.map(average).collect(),
        }
    }
}

impl Average {
    /// One more row; its mean with those before it, if there is one now.
    pub fn push(&mut self, row: &[f64], along: f64, is_first: bool) -> Averaged<'_> {
        if is_first {
            self.rows.clear();
            self.along.clear();
            self.until_mean = 0;
        }
        self.rows.extend_from_slice(row);
        self.along.push(along);
        let Some(first) = self.along.len().checked_sub(self.weights.len()) else {
            return if is_first {
                Averaged::Interrupted
            } else {
                Averaged::Nothing
            };
        };
        if self.until_mean > 0 {
            self.until_mean -= 1;
            return Averaged::Nothing;
        }
        self.until_mean = self.stride - 1;
        let way = self.along[first];
        let moves = way != 0.0 && self.along[first..].iter().all(|along| *along == way);
        if moves {
            self.mean.fill(0.0);
            let rows = self.rows[first * self.width..].chunks_exact(self.width);
            for (weight, row) in self.weights.iter().zip(rows) {
                for (mean, value) in self.mean.iter_mut().zip(row) {
                    *mean += weight * value;
                }
            }
        }
        // Seldom, so that moving the others costs nothing.
        if first > 256 {
            self.rows.drain(..first * self.width);
            self.along.drain(..first);
        }
        match moves {
            true => Averaged::Mean(&self.mean),
            false => Averaged::Interrupted,
        }
    }
}
