//! Sums of residuals and regressors over a block of time, one joint at a time.

use nalgebra::{DMatrix, DVector};

use super::averages::{Averaged, Averages};
use super::equations::Equations;
use super::grid::Sample;
use super::judgement::Verdict;

/// Smooth functions of a joint's angle, speed and direction, which stand for whatever the model lacks there.
pub(crate) const PROBES: usize = 6;

/// Means in a run of which the ends make up half of the noise: windows overlap by a quarter, and reach two over.
const CANCELLING: f64 = 16.0;

/// Which columns the residual of each joint depends on: hypotheses first, then the probes of each joint.
#[derive(Debug, Clone)]
pub(crate) struct Columns {
    pub hypotheses: usize,
    pub of_joint: Vec<Vec<usize>>,
}

impl Columns {
    pub fn new(hypotheses: usize, columns_of: &[Vec<usize>]) -> Self {
        let with_probes = |(joint, own): (usize, &Vec<usize>)| {
            let first = hypotheses + joint * PROBES;
            own.iter().copied().chain(first..first + PROBES).collect()
        };
        Self {
            hypotheses,
            of_joint: columns_of.iter().enumerate().map(with_probes).collect(),
        }
    }

    pub fn count(&self) -> usize {
        self.hypotheses + self.of_joint.len() * PROBES
    }

    /// The columns that may have any value after a change: what changed, and the probes of the joints that it acts on, since
    /// no regressor is exact.
    pub fn free_with(&self, verdict: &Verdict) -> Vec<usize> {
        let acts_on = |joint: &usize| match verdict {
            Verdict::Named(of) => of
                .first()
                .is_some_and(|h| self.of_joint[*joint].contains(h)),
            Verdict::Unexplained(own) => own == joint,
        };
        let joints = (0..self.of_joint.len()).filter(acts_on);
        let probes = joints.flat_map(|joint| self.probes(joint));
        match verdict {
            Verdict::Named(of) => of.iter().take(1).copied().chain(probes).collect(),
            Verdict::Unexplained(_) => probes.collect(),
        }
    }

    pub fn probes(&self, joint: usize) -> std::ops::Range<usize> {
        let first = self.hypotheses + joint * PROBES;
        first..first + PROBES
    }
}

/// Sums of one joint: the products of its columns with the residual, among each other, and the residual's square.
#[derive(Debug, Clone)]
pub(crate) struct JointSums {
    pub samples: usize,
    pub score: DVector<f64>,
    pub information: DMatrix<f64>,
    pub square: f64,
}

#[derive(Debug, Clone)]
pub(crate) struct Block {
    pub start_s: f64,
    pub end_s: f64,
    pub joints: Vec<JointSums>,
}

/// What the probes and the sums need to know of the joints.
#[derive(Debug, Clone, Default)]
pub(crate) struct Usual {
    /// Angles from which the probes count.
    pub origins: Vec<f64>,
    /// Speeds below which a joint with dry friction may rest; zero for the others. At rest, dry friction takes any torque, and
    /// smoothing does not tell when a joint began to move: windows in which it was that slow do not count for it.
    pub resting: Vec<f64>,
}

impl Block {
    /// The sums over samples, of which there is at least one.
    pub fn of(
        samples: &[Sample],
        equations: &mut Equations,
        columns: &Columns,
        (usual, averages): (&Usual, &mut Averages),
    ) -> Self {
        let empty = || columns.of_joint.iter().map(|own| JointSums::new(own.len()));
        let mut joints: Vec<JointSums> = empty().collect();
        let mut runs: Vec<JointSums> = empty().collect();
        let mut row = Vec::new();
        equations.over(samples, |at, joint, residual, regressors| {
            let sample = &samples[at];
            let angle = sample.q[joint] - usual.origins[joint];
            let speed = sample.qd[joint];
            let direction = sample.directions[joint];
            row.clear();
            row.push(residual);
            row.extend_from_slice(regressors);
            row.extend([1.0, angle, angle * angle, speed, direction, angle * speed]);
            // A direction of motion, or none.
            let along = if speed.abs() < usual.resting[joint] {
                0.0
            } else {
                speed.signum()
            };
            let along = if usual.resting[joint] > 0.0 {
                along
            } else {
                1.0
            };
            match averages.of_joint[joint].push(&row, along, sample.is_first) {
                Averaged::Mean([residual, x @ ..]) => runs[joint].add(*residual, x),
                Averaged::Interrupted => joints[joint].take(&mut runs[joint]),
                _ => {}
            }
        });
        for (own, run) in joints.iter_mut().zip(&mut runs) {
            own.take(run);
            own.mirror();
        }
        Self {
            start_s: samples[0].time,
            end_s: samples[samples.len() - 1].time,
            joints,
        }
    }

    /// Whether all sums are finite.
    pub fn is_finite(&self) -> bool {
        let mut joints = self.joints.iter();
        joints.all(|own| own.square.is_finite() && own.information.iter().all(|x| x.is_finite()))
    }
}

impl JointSums {
    fn new(columns: usize) -> Self {
        Self {
            samples: 0,
            score: DVector::zeros(columns),
            information: DMatrix::zeros(columns, columns),
            square: 0.0,
        }
    }

    fn add(&mut self, residual: f64, x: &[f64]) {
        self.samples += 1;
        self.square += residual * residual;
        for (column, value) in x.iter().enumerate() {
            self.score[column] += value * residual;
            // The lower triangle, which lies together in memory.
            let below = &mut self.information.column_mut(column);
            for (row, other) in x.iter().enumerate().skip(column) {
                below[row] += value * other;
            }
        }
    }

    /// Adds a run of means without interruption, and empties it. The noise of accelerations cancels between overlapping
    /// windows, but at the ends of a run: a long run is worth more than its share.
    fn take(&mut self, run: &mut Self) {
        if run.samples == 0 {
            return;
        }
        let weight = run.samples as f64 / (run.samples as f64 + CANCELLING);
        self.samples += run.samples;
        self.score.axpy(weight, &run.score, 1.0);
        self.information += &run.information * weight;
        self.square += weight * run.square;
        *run = Self::new(run.score.len());
    }

    fn mirror(&mut self) {
        self.information.fill_upper_triangle_with_lower_triangle();
    }
}

/// Scores and information of all columns over some blocks, with joints weighted by their noise.
#[derive(Debug, Clone)]
pub(crate) struct Sums {
    pub start_s: f64,
    pub end_s: f64,
    pub blocks: usize,
    pub score: DVector<f64>,
    pub information: DMatrix<f64>,
}

impl Sums {
    pub fn of(block: &Block, columns: &Columns, weights: &[f64]) -> Self {
        let count = columns.count();
        let mut sums = Self {
            start_s: block.start_s,
            end_s: block.end_s,
            blocks: 1,
            score: DVector::zeros(count),
            information: DMatrix::zeros(count, count),
        };
        for ((own, places), weight) in block.joints.iter().zip(&columns.of_joint).zip(weights) {
            for (i, row) in places.iter().enumerate() {
                sums.score[*row] += weight * own.score[i];
                for (k, column) in places.iter().enumerate() {
                    sums.information[(*row, *column)] += weight * own.information[(i, k)];
                }
            }
        }
        sums
    }

    /// Adds those of an earlier or a later stretch.
    pub fn add(&mut self, other: &Self) {
        self.start_s = self.start_s.min(other.start_s);
        self.end_s = self.end_s.max(other.end_s);
        self.blocks += other.blocks;
        self.score += &other.score;
        self.information += &other.information;
    }
}
