//! What the latest windows say: whether something has changed, and what explains it.

use nalgebra::{DMatrix, DVector};

use super::baseline::{Baseline, spreading};
use super::block::{Columns, Sums};
use super::history::History;
use super::hypothesis::Hypothesis;
use super::{Settings, tails};

/// What is left of a joint's probes after a change is taken off counts as nothing if chance leaves as much in one of this many
/// cases, or
const LEFT_BY_CHANCE: f64 = 0.003;
/// if it is this small a share of the whole: regressors of a model are not exact.
const LEFT_BY_MODEL: f64 = 0.03;
/// Two explanations whose likelihoods differ by less than a factor of 100 explain alike: twice its logarithm.
const ALIKE: f64 = 9.2;

/// The values that statistics exceed while nothing has changed as often as the user accepts.
#[derive(Debug, Clone)]
pub(crate) struct Thresholds {
    /// Of each hypothesis; infinite if the motion does not show it.
    pub hypotheses: Vec<f64>,
    /// Of each joint's probes.
    probes: Vec<f64>,
    /// Of what is left of them when a change is taken off.
    left: Vec<f64>,
}

/// A window and its statistics.
#[derive(Debug, Clone)]
pub(crate) struct Evidence {
    pub window: Sums,
    /// Squares of the normalised scores.
    hypotheses: Vec<f64>,
    probes: Vec<f64>,
    /// The largest statistic over its threshold.
    pub ratio: f64,
}

/// What has changed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Verdict {
    /// One of these hypotheses, the best first.
    Named(Vec<usize>),
    /// Something that none explains, on this joint.
    Unexplained(usize),
}

impl Thresholds {
    pub fn new(baseline: &Baseline, hypotheses: &[Hypothesis], settings: &Settings) -> Self {
        let shown = |own: &super::baseline::Scatter| own.variance > 0.0;
        let tests = baseline.hypotheses.iter().filter(|own| shown(own)).count()
            + baseline.probes.iter().flatten().count();
        let windows = History::windows_per_hour(settings.block_s);
        let p = settings.false_alarms_per_hour / windows / tests as f64;
        debug_assert_eq!(hypotheses.len(), baseline.hypotheses.len());
        let of_hypothesis = baseline.hypotheses.iter().map(|own| match shown(own) {
            true => tails::t_squared(p, own.freedom),
            false => f64::INFINITY,
        });
        let of_probes = |p: f64| -> Vec<f64> {
            let each = baseline.probes.iter().map(|own| match own {
                Some(own) => tails::hotelling(p, own.root.nrows(), own.blocks),
                None => f64::INFINITY,
            });
            each.collect()
        };
        Self {
            hypotheses: of_hypothesis.collect(),
            probes: of_probes(p),
            left: of_probes(LEFT_BY_CHANCE),
        }
    }
}

/// Everything that windows are judged by.
pub(crate) struct Judge<'m> {
    pub baseline: &'m Baseline,
    pub thresholds: &'m Thresholds,
    pub hypotheses: &'m [Hypothesis],
    pub columns: &'m Columns,
}

impl Judge<'_> {
    /// The window that speaks most for a change.
    pub fn strongest(&self, history: &History, all: bool) -> Option<Evidence> {
        let mut best: Option<Evidence> = None;
        history.windows(all, |window| {
            let evidence = self.evidence(window);
            if best.as_ref().is_none_or(|best| evidence.ratio > best.ratio) {
                best = Some(evidence);
            }
        });
        best
    }

    fn evidence(&self, window: &Sums) -> Evidence {
        let hypotheses: Vec<f64> = (0..self.hypotheses.len())
            .map(|h| self.of_hypothesis(window, h))
            .collect();
        let probes: Vec<f64> = (0..self.baseline.probes.len())
            .map(|joint| {
                self.of_probes(window, joint, &window.score, self.thresholds.probes[joint])
            })
            .collect();
        let both = [
            (&hypotheses, &self.thresholds.hypotheses),
            (&probes, &self.thresholds.probes),
        ];
        let ratios = both
            .iter()
            .flat_map(|(own, limits)| own.iter().zip(*limits));
        let ratio = ratios.map(|(own, limit)| own / limit).fold(0.0, f64::max);
        Evidence {
            window: window.clone(),
            hypotheses,
            probes,
            ratio,
        }
    }

    /// The square of a hypothesis' normalised score; zero if the window does not show it.
    fn of_hypothesis(&self, window: &Sums, h: usize) -> f64 {
        let information = window.information[(h, h)];
        let spread = self.baseline.hypotheses[h].variance;
        let floor = spread * information;
        if !(floor > 0.0) {
            return 0.0;
        }
        let square = window.score[h].powi(2);
        let threshold = self.thresholds.hypotheses[h];
        // The baseline's own error only lowers it.
        if square / floor < 0.1 * threshold {
            return square / floor;
        }
        let variance = self.variance(window, h);
        let least_seen = (threshold * variance).sqrt() / information;
        match least_seen < self.hypotheses[h].plausible() {
            true => square / variance,
            false => 0.0,
        }
    }

    /// Variance of a hypothesis' score in a window, with that of the baseline.
    fn variance(&self, window: &Sums, h: usize) -> f64 {
        let row = window.information.column(h);
        let of_baseline = row.dot(&(&self.baseline.covariance * row));
        let own = &self.baseline.hypotheses[h];
        let information = window.information[(h, h)];
        own.variance * (information + of_baseline) + own.misfit * information * information
    }

    /// By how much a hypothesis has changed in a window, and the half width of the 95 % interval.
    pub fn change(&self, window: &Sums, h: usize) -> [f64; 2] {
        let information = window.information[(h, h)];
        let freedom = self.baseline.hypotheses[h].freedom;
        let quantile = tails::t_squared(0.05, freedom).sqrt();
        [
            window.score[h] / information,
            quantile * self.variance(window, h).sqrt() / information,
        ]
    }

    /// The smallest change that is seen in such a window nine times in ten; `None` if no plausible one is.
    pub fn limit(&self, window: &Sums, h: usize) -> Option<f64> {
        let information = window.information[(h, h)];
        let threshold = self.thresholds.hypotheses[h];
        let limit =
            (threshold.sqrt() + NINE_IN_TEN) * self.variance(window, h).sqrt() / information;
        (limit < self.hypotheses[h].plausible()).then_some(limit)
    }

    /// Hotelling's T squared of a joint's probes for these scores, exactly if it is near a threshold or above.
    fn of_probes(&self, window: &Sums, joint: usize, score: &DVector<f64>, threshold: f64) -> f64 {
        let Some(own) = &self.baseline.probes[joint] else {
            return 0.0;
        };
        let places = self.columns.probes(joint);
        let (first, count) = (places.start, places.len());
        let score = &own.to_independent * score.rows(first, count);
        let information = window.information.view((first, first), (count, count));
        let information = &own.to_independent * information * own.to_independent.transpose();
        if !(information.trace() > 0.0) {
            return 0.0;
        }
        let scatter = &own.root * spreading(&information) * &own.root;
        let floor = squared_length(&scatter, &score);
        if floor < 0.1 * threshold {
            return floor;
        }
        let rows = window.information.columns(first, count);
        let of_baseline = rows.transpose() * &self.baseline.covariance * rows;
        let of_baseline = &own.to_independent * of_baseline * own.to_independent.transpose();
        let of_model = &information * &information * own.misfit;
        let all = scatter + &own.root * of_baseline * &own.root + of_model;
        squared_length(&all, &score)
    }

    /// What explains a window.
    pub fn verdict(
        &self,
        evidence: &Evidence,
        is_admissible: impl Fn(usize, f64) -> bool,
    ) -> Verdict {
        let window = &evidence.window;
        let most = evidence.probes.iter().copied().fold(0.0, f64::max);
        let explains = |h: usize| {
            let [change, _] = self.change(window, h);
            let left = &window.score - window.information.column(h) * change;
            let mut joints = 0..evidence.probes.len();
            joints.all(|joint| {
                let limit = self.thresholds.left[joint].max(LEFT_BY_MODEL * most);
                self.of_probes(window, joint, &left, limit) <= limit
            })
        };
        let mut ranked: Vec<usize> = (0..self.hypotheses.len())
            .filter(|h| {
                evidence.hypotheses[*h] > 0.0 && is_admissible(*h, self.change(window, *h)[0])
            })
            .collect();
        // The residual that each takes away, on one scale for all: their own scatters would favour some.
        let gain = |h: usize| window.score[h].powi(2) / window.information[(h, h)];
        ranked.sort_by(|a, b| gain(*b).total_cmp(&gain(*a)));
        let best = ranked.first().copied();
        let least = best.map_or(0.0, |best| {
            let scatter = gain(best) / evidence.hypotheses[best];
            (gain(best) - ALIKE * scatter).max(0.5 * gain(best))
        });
        ranked.retain(|h| gain(*h) >= least);
        ranked.retain(|h| explains(*h));
        let has_crossed =
            |h: &usize| evidence.hypotheses[*h] >= 0.5 * self.thresholds.hypotheses[*h];
        if ranked.iter().any(has_crossed) {
            return Verdict::Named(ranked);
        }
        let joints = 0..evidence.probes.len();
        let over = |joint: usize| evidence.probes[joint] / self.thresholds.probes[joint];
        let worst = joints.max_by(|a, b| over(*a).total_cmp(&over(*b)));
        Verdict::Unexplained(worst.unwrap_or(0))
    }
}

/// A standard normal variable is below it nine times in ten.
const NINE_IN_TEN: f64 = 1.2816;

/// `v' C^-1 v`; zero if the covariance cannot be inverted.
fn squared_length(covariance: &DMatrix<f64>, vector: &DVector<f64>) -> f64 {
    let cholesky = covariance.clone().cholesky();
    cholesky.map_or(0.0, |cholesky| vector.dot(&cholesky.solve(vector)))
}
