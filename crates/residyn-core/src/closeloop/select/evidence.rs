use nalgebra::DVector;
use statrs::distribution::{ContinuousCDF, FisherSnedecor, Normal};

use super::candidate::switches;
use super::trial::differences;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::identify::{Uncertainty, squared_distance, submatrix, uncertainty};

/// Fall of the loss as a share of the loss before.
pub fn gain(before: &[f64], after: &[f64]) -> f64 {
    1.0 - after.iter().sum::<f64>() / before.iter().sum::<f64>().max(f64::MIN_POSITIVE)
}

/// Probability, by the cluster-robust Wald test, of the fitted values of the k-th effect if it were absent. `None` for
/// an effect that no parameter value switches off.
pub fn p_value(problem: &Problem<'_>, fitted: &Fitted, k: usize) -> Option<f64> {
    p_value_by(
        &uncertainty(&problem.shooting, &fitted.fit),
        problem,
        fitted,
        k,
    )
}

/// The same with a known uncertainty of the fit, which takes long to find where there are many values.
pub fn p_value_by(
    uncertainty: &Uncertainty,
    problem: &Problem<'_>,
    fitted: &Fitted,
    k: usize,
) -> Option<f64> {
    let own = fitted.model.place_of(k);
    let all = switches(&fitted.model);
    let switches = (fitted.fit).columns_of(|k| own.contains(&k) && all.contains(&k));
    if switches.is_empty() {
        return None;
    }
    let covariance = submatrix(&uncertainty.covariance, &switches, &switches);
    let value = |&i: &usize| {
        let column = fitted.fit.columns[i];
        let log = column.log.map(|log| &problem.logs[log]);
        fitted.model.value_of(column.parameter, log)
    };
    let values = DVector::from_iterator(switches.len(), switches.iter().map(value));
    let statistic = squared_distance(&covariance, &values);
    Some(f_test(statistic, switches.len(), uncertainty.blocks))
}

/// Hotelling's form of the F test: a quadratic form in estimates whose covariance comes from few blocks.
pub fn f_test(statistic: f64, restrictions: usize, blocks: usize) -> f64 {
    let (q, freedom) = (restrictions as f64, blocks as f64 - restrictions as f64);
    if freedom < 1.0 {
        return 1.0;
    }
    let f = statistic * freedom / (q * (blocks as f64 - 1.0));
    // Values without spread, as on a joint at rest, are no evidence.
    if !f.is_finite() {
        return 1.0;
    }
    FisherSnedecor::new(q, freedom).map_or(1.0, |law| law.sf(f))
}

/// One-sided signed-rank test (Wilcoxon 1945) of the fall in loss over blocks, in its normal
/// approximation: effects that act in a few fast blocks give falls with tails too heavy for a t-test.
pub fn p_of_gains(before: &[f64], after: &[f64]) -> f64 {
    let mut falls = differences(before, after);
    falls.retain(|fall| *fall != 0.0);
    falls.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let count = falls.len() as f64;
    let ranks = falls.iter().zip(1..).filter(|(fall, _)| **fall > 0.0);
    let sum: f64 = ranks.map(|(_, rank)| f64::from(rank)).sum();
    let mean = count * (count + 1.0) / 4.0;
    let deviation = (count * (count + 1.0) * (2.0 * count + 1.0) / 24.0).sqrt();
    if deviation == 0.0 {
        return 1.0;
    }
    // Continuity correction of half a rank: ranks are whole numbers, the normal law is continuous.
    Normal::standard().sf((sum - 0.5 - mean) / deviation)
}
