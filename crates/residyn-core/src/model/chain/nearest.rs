//! The bodies nearest to given ones, subject to given sums of their parameters.
//!
//! A body is possible if its pseudo-inertia, the matrix of the second moments of its mass over (x, y, z, 1), is
//! positive definite. The distance between two bodies is the log-determinant Bregman divergence of these matrices,
//! which does not depend on frames or units and grows without bound towards impossible bodies (Lee, Wensing and Park,
//! Geometric robot dynamic identification, 2020).

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Vector3};

use super::spatial::Inertia;

/// A weighted sum of body parts, each with its factor and index: ten parts per body, in the order of
/// [`Inertia::of_parts`].
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

/// The parts of the bodies nearest to `bodies` that have these sums; none if there are no such bodies.
pub(super) fn nearest(bodies: &[[f64; 10]], sums: &[Sum]) -> Option<Vec<[f64; 10]>> {
    let is_body: Vec<bool> = bodies.iter().map(|parts| parts[0] > 0.0).collect();
    let start: Vec<Matrix4<f64>> = bodies
        .iter()
        .map(|parts| thickened(pseudo(parts)))
        .collect();
    let inverse = |matrix: &Matrix4<f64>| matrix.cholesky().map(|factors| factors.inverse());
    let declared: Vec<Matrix4<f64>> = (start.iter().zip(&is_body))
        .map(|(matrix, is_body)| {
            if *is_body {
                inverse(matrix)
            } else {
                Some(Matrix4::zeros())
            }
        })
        .collect::<Option<_>>()?;
    let mut now = bodies.to_vec();
    for (parts, matrix) in now.iter_mut().zip(&start) {
        *parts = parts_of(matrix);
    }
    for _ in 0..STEPS {
        let (step, length) = newton_step(&now, &declared, &is_body, sums)?;
        let moved = |share: f64| -> Vec<[f64; 10]> {
            let each = now.iter().zip(step.chunks_exact(10));
            each.map(|(parts, step)| std::array::from_fn(|k| parts[k] + share * step[k]))
                .collect()
        };
        let is_possible = |bodies: &[[f64; 10]]| {
            let mut real = bodies.iter().zip(&is_body).filter(|(_, is_body)| **is_body);
            real.all(|(parts, _)| pseudo(parts).cholesky().is_some())
        };
        let share = std::iter::successors(Some(1.0), |share| Some(0.5 * share))
            .take(40)
            .find(|share| is_possible(&moved(*share)))?;
        now = moved(share);
        if share == 1.0 && length < CONVERGED {
            return Some(now);
        }
    }
    None
}

/// The step to the least divergence under the sums, and its squared length.
fn newton_step(
    now: &[[f64; 10]],
    declared: &[Matrix4<f64>],
    is_body: &[bool],
    sums: &[Sum],
) -> Option<(Vec<f64>, f64)> {
    let (n, m) = (10 * now.len(), sums.len());
    let mut system = DMatrix::zeros(n + m, n + m);
    let mut wanted = DVector::zeros(n + m);
    for (b, parts) in now.iter().enumerate() {
        if !is_body[b] {
            (10 * b..10 * b + 10).for_each(|k| system[(k, k)] = 1.0);
            continue;
        }
        let inverse = pseudo(parts).cholesky()?.inverse();
        let turned: Vec<Matrix4<f64>> = (0..10).map(|k| inverse * pseudo(&unit(k))).collect();
        for i in 0..10 {
            wanted[10 * b + i] = turned[i].trace() - (declared[b] * pseudo(&unit(i))).trace();
            for j in 0..10 {
                system[(10 * b + i, 10 * b + j)] = (turned[i] * turned[j]).trace();
            }
        }
    }
    for (row, sum) in sums.iter().enumerate() {
        wanted[n + row] = sum.value;
        for (factor, at) in &sum.parts {
            wanted[n + row] -= factor * now[at / 10][at % 10];
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

fn unit(k: usize) -> [f64; 10] {
    std::array::from_fn(|other| if other == k { 1.0 } else { 0.0 })
}

/// Second moments of the mass over (x, y, z, 1).
fn pseudo(parts: &[f64; 10]) -> Matrix4<f64> {
    let Inertia {
        mass,
        moment,
        tensor,
    } = Inertia::of_parts(parts);
    let spread = Matrix3::identity() * (0.5 * tensor.trace()) - tensor;
    let mut all = Matrix4::zeros();
    all.fixed_view_mut::<3, 3>(0, 0).copy_from(&spread);
    all.fixed_view_mut::<3, 1>(0, 3).copy_from(&moment);
    all.fixed_view_mut::<1, 3>(3, 0)
        .copy_from(&moment.transpose());
    all[(3, 3)] = mass;
    all
}

/// The parts of the body with these second moments.
fn parts_of(moments: &Matrix4<f64>) -> [f64; 10] {
    let spread: Matrix3<f64> = moments.fixed_view::<3, 3>(0, 0).into();
    let moment: Vector3<f64> = moments.fixed_view::<3, 1>(0, 3).into();
    let t = Matrix3::identity() * spread.trace() - spread;
    let [x, y, z] = moment.into();
    [
        moments[(3, 3)],
        x,
        y,
        z,
        t[(0, 0)],
        t[(0, 1)],
        t[(0, 2)],
        t[(1, 1)],
        t[(1, 2)],
        t[(2, 2)],
    ]
}

/// The moments of a body that has some extent along every axis.
fn thickened(mut moments: Matrix4<f64>) -> Matrix4<f64> {
    if moments.cholesky().is_none() {
        let size = moments
            .fixed_view::<3, 3>(0, 0)
            .trace()
            .max(THICKNESS * moments[(3, 3)]);
        (0..3).for_each(|k| moments[(k, k)] += THICKNESS * size);
    }
    moments
}

#[cfg(test)]
mod tests {
    use super::{Sum, nearest, pseudo};

    /// A rod of 1 kg that reaches 0.6 m along z.
    const ROD: [f64; 10] = [1.0, 0.0, 0.0, 0.3, 0.121, 0.0, 0.0, 0.121, 0.0, 0.002];

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
            found[0] > 0.4_f64.powi(2) / 0.121 && pseudo(&found).cholesky().is_some(),
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
