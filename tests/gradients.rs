//! Derivatives with respect to every input of every model: ours against differences, f32 and Burn's own.

use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use residyn_core::expr::{Program, SignForm};
use residyn_core::model::Dynamics;
use residyn_train::replay;

use crate::support::catalogue::{
    Case, assert_all_near, assert_near, catalog, column, in_f32, jacobian, point, points, rng,
};
use crate::support::tensors::{devices, numbers, tensor};

/// Wide enough that the third derivatives of tanh(v / width) leave four digits to central differences.
const SIGNS: [SignForm; 2] = [SignForm::Exact, SignForm::Smooth { width: 0.3 }];
/// f32 keeps 6e-8 of a value; derivatives multiply the accelerations' terms by up to 1 / (mass of the
/// pole): measured up to 4e-5 of max(1, value), for 12^2 sin(12 q) cogs.
const F32: f64 = 1e-4;
const ROWS: usize = 16;

fn cases() -> impl Iterator<Item = Case> {
    SIGNS.into_iter().flat_map(catalog)
}

/// The accelerations' central difference by input k over 2 h.
fn difference(program: &Program, joints: usize, point: &[f64], k: usize, h: f64) -> Vec<f64> {
    let at = |by: f64| {
        let mut point = point.to_vec();
        point[k] += by;
        program.eval(&point)[joints..].to_vec()
    };
    at(h)
        .iter()
        .zip(at(-h))
        .map(|(a, b)| (a - b) / (2.0 * h))
        .collect()
}

/// Derivatives of fourth order (Richardson), or `None` if a kink is within reach: there the two differences disagree by
/// more than their error of order h^2.
fn slope(model: &Dynamics, point: &[f64], k: usize) -> Option<Vec<f64>> {
    let (program, joints) = (&model.program, model.joints);
    let layout = model.layout();
    let is_internal = layout.internal().contains(&k) || layout.starts().contains(&k);
    let least = match program.inputs()[k].as_str() {
        // What acts within a step changes with the inverse of its length.
        "step_s" => 0.0,
        // A deflection moves over as much.
        _ if is_internal => 0.02,
        _ => 0.1,
    };
    let h = 3e-4 * point[k].abs().max(least);
    let coarse = difference(program, joints, point, k, h);
    let fine = difference(program, joints, point, k, h / 2.0);
    let pairs = coarse.iter().zip(&fine);
    let smooth = pairs
        .clone()
        .all(|(a, b)| (a - b).abs() < 1e-3 * b.abs().max(1.0));
    smooth.then(|| pairs.map(|(a, b)| b + (b - a) / 3.0).collect())
}

/// A point and the derivatives there `[input][joint]`, away from kinks.
fn smooth_point(model: &Dynamics, rng: &mut ChaCha8Rng) -> (Vec<f64>, Vec<Vec<f64>>) {
    for _ in 0..20 {
        let point = point(model, rng);
        let inputs = 0..point.len();
        let slopes: Option<Vec<_>> = inputs.map(|k| slope(model, &point, k)).collect();
        if let Some(slopes) = slopes {
            return (point, slopes);
        }
    }
    panic!("no smooth point in 20");
}

#[test]
fn gradients_match_finite_differences() {
    let mut rng = rng(21);
    for case in cases() {
        let jacobian = jacobian(&case.dynamics);
        for _ in 0..8 {
            let (point, slopes) = smooth_point(&case.dynamics, &mut rng);
            let found = jacobian.eval(&point);
            for (k, slopes) in slopes.iter().enumerate() {
                for (joint, wanted) in slopes.iter().enumerate() {
                    let what = format!("{} by {}", case.name, case.dynamics.program.inputs()[k]);
                    // Richardson's error is h^4 f''''' / 480 with h near 3e-4 of the input, rounding
                    // 1e-15 / h: both far below.
                    assert_near(found[joint * point.len() + k], *wanted, 1e-7, &what);
                }
            }
        }
    }
}

#[test]
fn gradients_in_f32_lanes_agree_with_f64() {
    for (k, case) in cases().enumerate() {
        let jacobian = jacobian(&case.dynamics);
        let points = points(&case.dynamics, ROWS, k as u64);
        for (point, found) in points.iter().zip(in_f32(&jacobian, &points)) {
            let wanted = jacobian.eval(point);
            assert_all_near(&found, &wanted, F32, &case.name);
        }
    }
}

#[test]
fn burn_differentiates_the_replay_as_we_do() {
    for device in devices() {
        for (k, case) in cases().enumerate() {
            let mut points = points(&case.dynamics, ROWS, k as u64);
            // Parameters are shared by all rows, as in training: their gradient is the sum over the rows.
            let states = case.dynamics.layout().parameters();
            let parameters = points[0][states..].to_vec();
            points
                .iter_mut()
                .for_each(|point| point[states..].copy_from_slice(&parameters));
            for joint in 0..case.dynamics.joints {
                check_burn(&case, &points, joint, &device);
            }
        }
    }
}

fn check_burn(case: &Case, points: &[Vec<f64>], joint: usize, device: &Device) {
    let (n, inputs) = (case.dynamics.joints, points[0].len());
    let columns: Vec<Tensor<1>> = (0..inputs)
        .map(|k| match k < case.dynamics.layout().parameters() {
            true => tensor(&column(points, k), device).require_grad(),
            false => tensor(&points[0][k..=k], device).require_grad(),
        })
        .collect();
    let accelerations = replay(&case.dynamics.program, &columns).swap_remove(n + joint);
    let gradients = accelerations.sum().backward();
    let jacobian = jacobian(&case.dynamics);
    let rows: Vec<Vec<f64>> = points.iter().map(|point| jacobian.eval(point)).collect();
    for (k, input) in columns.iter().enumerate() {
        let wanted = column(&rows, joint * inputs + k);
        // No gradient is a gradient of zero.
        let found = input
            .grad(&gradients)
            .map_or(vec![0.0; input.dims()[0]], numbers);
        let what = format!("{} by {}", case.name, case.dynamics.program.inputs()[k]);
        if found.len() == ROWS {
            assert_all_near(&found, &wanted, F32, &what);
        } else {
            // The rounding of a sum is measured relative to its terms.
            let size: f64 = wanted.iter().map(|w| w.abs()).sum::<f64>().max(1.0);
            let sum: f64 = wanted.iter().sum();
            assert_near(found[0] / size, sum / size, F32, &what);
        }
    }
}
