//! The healthy state: by how much the model is off already, and how far scores scatter while nothing changes.

use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};
use residyn_core::decomposition::eigen;

use super::block::{Block, Columns, JointSums, Sums};
use super::hypothesis::Hypothesis;
use super::tails;

/// Probes count as one where all but this share of one is the other.
const SAME_PROBE: f64 = 1e-6;
/// What is added to information of unit diagonal so that it can be inverted; far below what noise leaves of it.
const RIDGE: f64 = 1e-9;
/// Correlation of neighbouring blocks beyond which blocks are too short to say how far their sums scatter.
const MOST_CORRELATED: f64 = 0.8;
/// A residual that is this small a share of the torques is rounding.
const ROUNDING: f64 = 1e-20;
/// The share of a joint's residual that the misfit of a good model may be in a direction, depending on the motion.
const MISFIT: f64 = 0.05;
/// Lengths of the windows in whose statistics tails are looked at, in blocks, and the least number of them.
const WINDOWS: [usize; 3] = [1, 4, 16];
const LEAST_WINDOWS: f64 = 8.0;
/// The misfit that the probes may have before any data, in standard deviations of the residual.
const PROBE_PRIOR: f64 = 10.0;

/// Where the machine stands, and how far the scores of blocks scatter about zero there.
#[derive(Debug, Clone)]
pub(crate) struct Baseline {
    /// 1 / variance of each joint's residual; zero for a joint that does not move.
    pub weights: Vec<f64>,
    /// The values of all columns by which the machine differs from its model.
    pub offset: DVector<f64>,
    /// Their covariance, for scores that scatter as white residuals would.
    pub covariance: DMatrix<f64>,
    pub hypotheses: Vec<Scatter>,
    /// `None` for a joint without weight.
    pub probes: Vec<Option<ProbeScatter>>,
}

/// How far a hypothesis' scores scatter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scatter {
    /// Variance of a window's score per information in it; 1 for white residuals.
    pub variance: f64,
    /// Independent blocks that it is known from, less one.
    pub freedom: f64,
    /// What the model's misfit adds to the variance, per square of the information.
    pub misfit: f64,
}

/// How far the scores of a joint's probes scatter.
#[derive(Debug, Clone)]
pub(crate) struct ProbeScatter {
    /// From the probes to combinations of unit information in a healthy block.
    pub to_independent: DMatrix<f64>,
    /// Root of the covariance of these in a healthy block.
    pub root: DMatrix<f64>,
    /// Independent blocks that it is known from.
    pub blocks: f64,
    /// What the model's misfit adds to the covariance, per square of the information.
    pub misfit: f64,
}

impl Baseline {
    /// From healthy blocks. `None` if no joint moves.
    pub fn of(blocks: &[Block], columns: &Columns, hypotheses: &[Hypothesis]) -> Option<Self> {
        let weight = |joint: usize| weight(blocks.iter().map(|block| &block.joints[joint]));
        let weights: Vec<f64> = (0..columns.of_joint.len()).map(weight).collect();
        if weights.iter().all(|weight| *weight == 0.0) {
            return None;
        }
        let each: Vec<Sums> = blocks
            .iter()
            .map(|block| Sums::of(block, columns, &weights))
            .collect();
        let mut total = each[0].clone();
        each[1..].iter().for_each(|sums| total.add(sums));
        let samples = |joint: usize| -> usize {
            blocks.iter().map(|block| block.joints[joint].samples).sum()
        };
        let priors: Vec<f64> = (0..columns.count())
            .map(|column| match hypotheses.get(column) {
                Some(hypothesis) => hypothesis.prior.powi(2),
                None => {
                    let joint = (column - columns.hypotheses) / super::block::PROBES;
                    let information = total.information[(column, column)];
                    match information > 0.0 {
                        true => PROBE_PRIOR.powi(2) * samples(joint) as f64 / information,
                        false => 1.0,
                    }
                }
            })
            .collect();
        // How far scores scatter decides what the priors weigh, and the offsets decide how far scores scatter.
        let first = Self::with_priors(&each, &total, &weights, columns, |column| {
            1.0 / priors[column]
        });
        let scatter = first.hypotheses;
        let weighs =
            |column: usize| scatter.get(column).map_or(1.0, |own| own.variance) / priors[column];
        let mut found = Self::with_priors(&each, &total, &weights, columns, weighs);
        found.give_misfit(&total, columns, hypotheses);
        Some(found)
    }

    fn with_priors(
        each: &[Sums],
        total: &Sums,
        weights: &[f64],
        columns: &Columns,
        precision: impl Fn(usize) -> f64,
    ) -> Self {
        let mut information = total.information.clone();
        for column in 0..columns.count() {
            information[(column, column)] += precision(column);
        }
        let covariance = inverted(&information);
        let offset = &covariance * &total.score;
        // Each block by the offsets that all others give: those that it gives itself would take its scatter away.
        let left_out = |own: &Sums| {
            let of_others = inverted(&(&information - &own.information));
            let offset = &of_others * (&total.score - &own.score);
            let score = &own.score - &own.information * offset;
            let information = &own.information + &own.information * of_others * &own.information;
            Sums {
                score,
                information,
                ..own.clone()
            }
        };
        let left: Vec<Sums> = each.iter().map(left_out).collect();
        let scatter = |column: usize| {
            let own = left
                .iter()
                .map(|sums| [sums.score[column], sums.information[(column, column)]]);
            scatter(&own.collect::<Vec<[f64; 2]>>())
        };
        let probes = |joint: usize| {
            (weights[joint] > 0.0).then(|| probes(each, &left, columns.probes(joint)))
        };
        Self {
            weights: weights.to_vec(),
            hypotheses: (0..columns.hypotheses).map(scatter).collect(),
            probes: (0..weights.len())
                .map(|joint| probes(joint).flatten())
                .collect(),
            offset,
            covariance,
        }
    }

    /// A misfit of the model that changes with the motion does not average out as noise does: in every direction it may be this
    /// share of the residual.
    fn give_misfit(&mut self, total: &Sums, columns: &Columns, hypotheses: &[Hypothesis]) {
        let blocks = total.blocks as f64;
        // The first probe is the constant: its information is the number of means.
        let means = |joint: usize| {
            let first = columns.probes(joint).start;
            match self.weights[joint] > 0.0 {
                true => total.information[(first, first)] / self.weights[joint] / blocks,
                false => 0.0,
            }
        };
        let joints = 0..self.weights.len();
        let variance: Vec<f64> = joints.map(|joint| MISFIT.powi(2) * means(joint)).collect();
        for (h, own) in self.hypotheses.iter_mut().enumerate() {
            let information = total.information[(h, h)] / blocks;
            if information > 0.0 {
                own.misfit = variance[hypotheses[h].joint] / information;
            }
        }
        for (own, variance) in self.probes.iter_mut().zip(variance) {
            if let Some(own) = own {
                own.misfit = variance;
            }
        }
    }

    /// The sums of a block, with what the machine differs by already taken off its scores.
    pub fn beyond(&self, block: &Block, columns: &Columns) -> Sums {
        let mut sums = Sums::of(block, columns, &self.weights);
        sums.score -= &sums.information * &self.offset;
        sums
    }

    /// Takes a change of some columns into the baseline: they may have any value now, and a window tells which.
    pub fn absorb(&mut self, changed: &[usize], window: &Sums) {
        for column in changed {
            let information = window.information[(*column, *column)];
            if information > 0.0 {
                // A million times what the window leaves open.
                self.covariance[(*column, *column)] += 1e6 / information;
            }
        }
        // (C^-1 + A)^-1 = C - C A (1 + C A)^-1 C
        let through = &self.covariance * &window.information;
        let count = through.nrows();
        let Some(gain) = (DMatrix::identity(count, count) + &through)
            .lu()
            .solve(&self.covariance)
        else {
            return;
        };
        self.covariance = 0.5 * (&gain + gain.transpose());
        self.offset += &self.covariance * &window.score;
    }
}

/// 1 / variance of a joint's residual about its own regression; zero if the joint does not move.
fn weight<'b>(blocks: impl Iterator<Item = &'b JointSums>) -> f64 {
    let mut blocks = blocks;
    let Some(mut total) = blocks.next().cloned() else {
        return 0.0;
    };
    for own in blocks {
        total.samples += own.samples;
        total.score += &own.score;
        total.information += &own.information;
        total.square += own.square;
    }
    let columns = total.score.len();
    if total.samples <= 2 * columns {
        return 0.0;
    }
    let values = inverted(&total.information) * &total.score;
    let left = (total.square - values.dot(&total.score)).max(ROUNDING * total.square);
    match left > 0.0 {
        true => (total.samples - columns) as f64 / left,
        false => 0.0,
    }
}

/// The inverse of an information matrix, whose columns may have any scale. A column without information stays without.
fn inverted(information: &DMatrix<f64>) -> DMatrix<f64> {
    let scale = information
        .diagonal()
        .map(|own| if own > 0.0 { 1.0 / own.sqrt() } else { 0.0 });
    let count = scale.len();
    let mut scaled = DMatrix::from_fn(count, count, |i, k| {
        information[(i, k)] * scale[i] * scale[k]
    });
    for k in 0..count {
        scaled[(k, k)] = 1.0 + RIDGE;
    }
    let inverse = match scaled.clone().cholesky() {
        Some(cholesky) => cholesky.inverse(),
        // Rounding: the nearest matrix that can be inverted.
        None => {
            let SymmetricEigen {
                eigenvalues,
                eigenvectors,
            } = eigen_of(scaled);
            let inverse = DMatrix::from_diagonal(&eigenvalues.map(|value| 1.0 / value.max(RIDGE)));
            &eigenvectors * inverse * eigenvectors.transpose()
        }
    };
    DMatrix::from_fn(count, count, |i, k| inverse[(i, k)] * scale[i] * scale[k])
}

/// Of `[score, information]` block by block.
fn scatter(blocks: &[[f64; 2]]) -> Scatter {
    let count = blocks.len() as f64;
    let information: f64 = blocks.iter().map(|[_, information]| information).sum();
    if !(information > 0.0) {
        return Scatter {
            variance: 0.0,
            freedom: 1.0,
            misfit: 0.0,
        };
    }
    let square: f64 = blocks.iter().map(|[score, _]| score * score).sum();
    let scaled = blocks
        .iter()
        .map(|[score, information]| match *information > 0.0 {
            true => score / information.sqrt(),
            false => 0.0,
        });
    let scaled: Vec<f64> = scaled.collect();
    let longer = lasting(&scaled);
    // Two values, those of offset and scatter, come from the same blocks.
    let variance = square / information * count / (count - 2.0);
    let freedom = ((count - 2.0) / longer).max(3.0);
    let draws: Vec<DVector<f64>> = scaled
        .iter()
        .map(|draw| DVector::from_element(1, *draw))
        .collect();
    let square = |draw: &DVector<f64>| draw[0] * draw[0] / variance;
    let heavier = heaviness(&draws, square, |p| tails::t_squared(p, freedom));
    Scatter {
        variance: variance * longer.max(heavier),
        freedom,
        misfit: 0.0,
    }
}

/// By what factor the variance of a long sum exceeds that of as many independent draws, if neighbours are correlated as these
/// are and others by the powers of it (first-order autoregression).
fn lasting(draws: &[f64]) -> f64 {
    let square: f64 = draws.iter().map(|draw| draw * draw).sum();
    let product: f64 = draws.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = (product / square).clamp(0.0, MOST_CORRELATED);
    match square > 0.0 {
        true => (1.0 + correlation) / (1.0 - correlation),
        false => 1.0,
    }
}

/// By what factor a variance has to be larger for the largest statistic of healthy windows of any of these lengths to be
/// where it is as often as not: tails that are heavier than those of a normal distribution, and misfits that last.
fn heaviness(
    draws: &[DVector<f64>],
    statistic: impl Fn(&DVector<f64>) -> f64,
    threshold: impl Fn(f64) -> f64,
) -> f64 {
    let of_length = |length: &usize| {
        let windows = draws.chunks_exact(*length);
        let count = windows.len() as f64;
        let sum = |window: &[DVector<f64>]| -> f64 {
            let sum = window
                .iter()
                .fold(window[0].clone() * 0.0, |sum, draw| sum + draw);
            statistic(&(sum / (*length as f64).sqrt()))
        };
        match count >= LEAST_WINDOWS {
            true => windows.map(sum).fold(0.0, f64::max) / threshold(0.5 / count),
            false => 1.0,
        }
    };
    WINDOWS.iter().map(of_length).fold(1.0, f64::max)
}

/// `None` if none of the probes is excited.
fn probes(each: &[Sums], left: &[Sums], places: std::ops::Range<usize>) -> Option<ProbeScatter> {
    let (first, count) = (places.start, places.len());
    let blocks = each.len() as f64;
    let square = |sums: &Sums| {
        sums.information
            .view((first, first), (count, count))
            .into_owned()
    };
    let mean = each
        .iter()
        .map(square)
        .fold(DMatrix::zeros(count, count), |sum, own| sum + own)
        / blocks;
    let information = mean.diagonal();
    let scale = information.map(|own| if own > 0.0 { 1.0 / own.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(count, count, |i, k| mean[(i, k)] * scale[i] * scale[k]);
    let SymmetricEigen {
        eigenvalues,
        eigenvectors,
    } = eigen_of(scaled);
    let kept: Vec<usize> = (0..count)
        .filter(|k| eigenvalues[*k] > SAME_PROBE * count as f64)
        .collect();
    if kept.is_empty() {
        return None;
    }
    let to_independent = DMatrix::from_fn(kept.len(), count, |i, k| {
        eigenvectors[(k, kept[i])] * scale[k] / eigenvalues[kept[i]].sqrt()
    });
    // As they would be if each block had the information of the mean.
    let draw = |left: &Sums| -> DVector<f64> {
        let scale = spreading(&(&to_independent * square(left) * to_independent.transpose()));
        let draw = &to_independent * left.score.rows(first, count);
        let SymmetricEigen {
            eigenvalues,
            eigenvectors,
        } = eigen_of(scale);
        let inverse = eigenvalues.map(|value| {
            if value > 0.0 {
                value.sqrt().recip()
            } else {
                0.0
            }
        });
        &eigenvectors * (eigenvectors.transpose() * draw).component_mul(&inverse)
    };
    let draws: Vec<DVector<f64>> = left.iter().map(draw).collect();
    let covariance = draws
        .iter()
        .fold(DMatrix::zeros(kept.len(), kept.len()), |sum, draw| {
            sum + draw * draw.transpose()
        });
    let of_row = |row: usize| lasting(&draws.iter().map(|draw| draw[row]).collect::<Vec<f64>>());
    let longer = (0..kept.len()).map(of_row).sum::<f64>() / kept.len() as f64;
    let covariance = covariance / (blocks - 2.0);
    let independent = ((blocks - 2.0) / longer).max(kept.len() as f64 + 3.0);
    let inverse = covariance.clone().cholesky()?;
    let square = |draw: &DVector<f64>| draw.dot(&inverse.solve(draw));
    let threshold = |p: f64| tails::hotelling(p, kept.len(), independent);
    let heavier = heaviness(&draws, square, threshold);
    Some(ProbeScatter {
        to_independent,
        root: root(&(covariance * longer.max(heavier))),
        blocks: independent,
        misfit: 0.0,
    })
}

/// How the covariance of a window's scores goes with its information about independent probes: half by each direction, half
/// by the whole. Noise that is not white puts some into directions that a short window hardly shows.
pub(crate) fn spreading(information: &DMatrix<f64>) -> DMatrix<f64> {
    let count = information.nrows();
    let whole = information.trace() / count as f64;
    0.5 * (information + DMatrix::identity(count, count) * whole)
}

fn eigen_of(symmetric: DMatrix<f64>) -> SymmetricEigen<f64, Dyn> {
    eigen(symmetric).expect("the sums of a block were found to be finite")
}

/// The symmetric root of a covariance.
pub(crate) fn root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let SymmetricEigen {
        eigenvalues,
        eigenvectors,
    } = eigen_of(covariance.clone());
    let roots = DMatrix::from_diagonal(&eigenvalues.map(|value| value.max(0.0).sqrt()));
    &eigenvectors * roots * eigenvectors.transpose()
}
