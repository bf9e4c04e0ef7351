//! The bodies nearest to given ones, subject to given sums of their parameters.
//!
//! How near a body is to another is their [`Divergence`], which grows without bound towards impossible bodies.

use nalgebra::{DMatrix, DVector};

use super::pseudo_inertia::{Divergence, is_physical};
use super::spatial::{PARTS, Parts};

/// A weighted sum of body parts, each with its factor and its index among the parts of all bodies.
pub(super) struct Sum {
    pub parts: Vec<(f64, usize)>,
    pub value: f64,
}

/// Newton steps at most; a handful is usual.
const STEPS: usize = 100;
/// How much a flat or pointlike body is thickened, relative to its size: its pseudo-inertia has no inverse.
const THICKNESS: f64 = 1e-6;
/// Squared length of the last step, in the metric of the divergence.
const CONVERGED: f64 = 1e-20;

/// The parts of the bodies nearest to `bodies` that have these sums; none if there are no such bodies. A body without mass
/// has no distance to others: only sums change it.
pub(super) fn nearest(bodies: &[Parts], sums: &[Sum]) -> Option<Vec<Parts>> {
    let mut now: Vec<Parts> = bodies.iter().map(thickened).collect();
    let divergences: Vec<Option<Divergence>> = (now.iter())
        .map(|parts| match parts[0] > 0.0 {
            true => Divergence::from_body(parts).map(Some),
            false => Some(None),
        })
        .collect::<Option<_>>()?;
    for _ in 0..STEPS {
        let (step, length) = newton_step(&now, &divergences, sums)?;
        let moved = |share: f64| -> Vec<Parts> {
            let each = now.iter().zip(step.chunks_exact(PARTS));
            each.map(|(parts, step)| std::array::from_fn(|k| parts[k] + share * step[k]))
                .collect()
        };
        let are_possible = |moved: &[Parts]| {
            let mut all = moved.iter().zip(&divergences);
            all.all(|(parts, divergence)| divergence.is_none() || is_physical(parts))
        };
        let share = std::iter::successors(Some(1.0), |share| Some(0.5 * share))
            .take(40)
            .find(|share| are_possible(&moved(*share)))?;
        now = moved(share);
        if share == 1.0 && length < CONVERGED {
            return Some(now);
        }
    }
    None
}

/// The step to the least divergence under the sums, and its squared length.
fn newton_step(
    now: &[Parts],
    divergences: &[Option<Divergence>],
    sums: &[Sum],
) -> Option<(Vec<f64>, f64)> {
    let (n, m) = (PARTS * now.len(), sums.len());
    let mut system = DMatrix::zeros(n + m, n + m);
    let mut wanted = DVector::zeros(n + m);
    for (b, (parts, divergence)) in now.iter().zip(divergences).enumerate() {
        let at = PARTS * b;
        let mut own = system.view_mut((at, at), (PARTS, PARTS));
        match divergence {
            None => own.fill_with_identity(),
            Some(divergence) => {
                let (gradient, hessian) = divergence.terms(parts)?;
                own.copy_from(&hessian);
                wanted.rows_mut(at, PARTS).copy_from(&-gradient);
            }
        }
    }
    for (row, sum) in sums.iter().enumerate() {
        wanted[n + row] = sum.value;
        for (factor, at) in &sum.parts {
            wanted[n + row] -= factor * now[at / PARTS][at % PARTS];
            system[(n + row, *at)] = *factor;
            system[(*at, n + row)] = *factor;
        }
    }
    let curvature = system.view((0, 0), (n, n)).into_owned();
    let solution = equilibrated(system, wanted)?;
    let step = solution.rows(0, n).into_owned();
    let length = step.dot(&(curvature * &step));
    length
        .is_finite()
        .then(|| (step.as_slice().to_vec(), length))
}

/// The solution of a symmetric system, its rows and columns scaled to similar size: masses and inertias differ by
/// orders of magnitude.
fn equilibrated(mut system: DMatrix<f64>, mut wanted: DVector<f64>) -> Option<DVector<f64>> {
    let mut scales = vec![1.0; wanted.len()];
    for _ in 0..4 {
        for k in 0..scales.len() {
            let scale = system.row(k).amax().max(f64::MIN_POSITIVE).powf(-0.5);
            scales[k] *= scale;
            wanted[k] *= scale;
            system.row_mut(k).scale_mut(scale);
            system.column_mut(k).scale_mut(scale);
        }
    }
    let mut solution = system.lu().solve(&wanted)?;
    for (value, scale) in solution.iter_mut().zip(&scales) {
        *value *= scale;
    }
    Some(solution)
}

/// A body with mass, with some extent along every axis.
fn thickened(parts: &Parts) -> Parts {
    let [mass, .., xx, _, _, yy, _, zz] = *parts;
    let mut thick = *parts;
    if mass > 0.0 && !is_physical(parts) {
        let size = (0.5 * (xx + yy + zz)).max(THICKNESS * mass);
        for k in [4, 7, 9] {
            thick[k] += 2.0 * THICKNESS * size;
        }
    }
    thick
}

#[cfg(test)]
mod tests {
    use super::{Parts, Sum, is_physical, nearest};

    /// A rod of 1 kg that reaches 0.6 m along z.
    const ROD: Parts = [1.0, 0.0, 0.0, 0.3, 0.121, 0.0, 0.0, 0.121, 0.0, 0.002];

    #[test]
    fn bodies_with_the_same_sums_stay() {
        let sums = [(7, 0.121), (3, 0.3)].map(|(at, value)| Sum {
            parts: vec![(1.0, at)],
            value,
        });
        let found = nearest(&[ROD], &sums).unwrap()[0];
        assert!(
            found.iter().zip(&ROD).all(|(a, b)| (a - b).abs() < 1e-14),
            "{found:?}"
        );
    }

    #[test]
    fn more_weight_at_the_same_inertia_is_a_heavier_body_further_in() {
        let sums = [(7, 0.121), (3, 0.4)].map(|(at, value)| Sum {
            parts: vec![(1.0, at)],
            value,
        });
        let found = nearest(&[ROD], &sums).unwrap()[0];
        assert!(
            (found[7] - 0.121).abs() < 1e-14 && (found[3] - 0.4).abs() < 1e-14,
            "{found:?}"
        );
        assert!(
            found[0] > 0.4_f64.powi(2) / 0.121 && is_physical(&found),
            "{found:?}"
        );
    }

    #[test]
    fn there_is_no_body_of_negative_inertia() {
        let sum = Sum {
            parts: vec![(1.0, 7)],
            value: -0.1,
        };
        assert!(nearest(&[ROD], &[sum]).is_none());
    }
}
