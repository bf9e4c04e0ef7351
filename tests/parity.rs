//! All readers of a program compute the same function: f64, f32, many lanes, Burn's tensors.

use burn::tensor::{Device, Tensor};
use residyn_core::expr::{Program, SignForm};
use residyn_core::lanes::Row;

use crate::support::catalogue::{assert_all_near, assert_near, catalog, column, in_f32, points};
use crate::support::tensors::{devices, numbers, tensor};

/// f32 keeps 24 bits, 6e-8 of a value. The accelerations here are sums of terms up to some tens whose
/// angles (up to 12 q) are rounded as well: measured up to 5e-6 of max(1, value).
const F32: f64 = 1e-5;
/// Vector lanes round a product and a sum together, and compute sines to two units in the last place: measured up to
/// 3e-14 of max(1, value).
const F64: f64 = 1e-13;
const ROWS: usize = 48;

const SIGNS: [SignForm; 2] = [SignForm::Exact, SignForm::Smooth { width: 0.05 }];

fn cases() -> impl Iterator<Item = (String, Program, Vec<Vec<f64>>)> {
    SIGNS
        .into_iter()
        .flat_map(catalog)
        .enumerate()
        .map(|(k, case)| {
            let points = points(&case.dynamics, ROWS, k as u64);
            (case.name, case.dynamics.program, points)
        })
}

#[test]
fn eight_lanes_give_the_values_of_one() {
    for (name, program, points) in cases() {
        let mut tape = program.tape::<f64, 8>();
        for points in points.chunks_exact(8) {
            for (k, slot) in tape.inputs().iter_mut().enumerate() {
                *slot = Row(std::array::from_fn(|lane| points[lane][k]));
            }
            tape.run();
            for (lane, point) in points.iter().enumerate() {
                for (o, wanted) in program.eval(point).into_iter().enumerate() {
                    assert_near(tape.output(o)[lane], wanted, F64, &name);
                }
            }
        }
    }
}

#[test]
fn sixteen_lanes_of_f32_agree_with_f64() {
    for (name, program, points) in cases() {
        compare(&name, &program, &points, &in_f32(&program, &points));
    }
}

#[test]
fn burn_replays_the_program() {
    for device in devices() {
        for (name, program, points) in cases() {
            let inputs: Vec<Tensor<1>> = (0..program.inputs().len())
                .map(|k| tensor(&column(&points, k), &device))
                .collect();
            compare(&name, &program, &points, &replay(&program, &inputs));
        }
    }
}

#[test]
fn burn_replays_inputs_that_all_rows_share() {
    for device in devices() {
        for (name, program, points) in cases() {
            // Every third input is shared by all rows, starting from a different one in each case.
            let shared = |k: usize| (k + name.len()).is_multiple_of(3);
            check_shared(&name, &program, &points, &device, shared);
            // All inputs but the first are shared, as parameters and a constant torque are.
            check_shared(&name, &program, &points, &device, |k| k > 0);
        }
    }
}

fn check_shared(
    name: &str,
    program: &Program,
    points: &[Vec<f64>],
    device: &Device,
    shared: impl Fn(usize) -> bool,
) {
    let mut points = points.to_vec();
    let first = points[0].clone();
    for point in &mut points {
        (0..first.len())
            .filter(|k| shared(*k))
            .for_each(|k| point[k] = first[k]);
    }
    let inputs: Vec<Tensor<1>> = (0..first.len())
        .map(|k| match shared(k) {
            true => tensor(&first[k..=k], device),
            false => tensor(&column(&points, k), device),
        })
        .collect();
    compare(name, program, &points, &replay(program, &inputs));
}

/// `[row][output]`; outputs that all rows share are repeated.
fn replay(program: &Program, inputs: &[Tensor<1>]) -> Vec<Vec<f64>> {
    let outputs: Vec<Vec<f64>> = residyn_train::replay(program, inputs)
        .into_iter()
        .map(numbers)
        .collect();
    let of_row = |values: &Vec<f64>, row: usize| match values.len() {
        1 => values[0],
        rows => {
            assert_eq!(rows, ROWS);
            values[row]
        }
    };
    (0..ROWS)
        .map(|row| outputs.iter().map(|values| of_row(values, row)).collect())
        .collect()
}

fn compare(name: &str, program: &Program, points: &[Vec<f64>], found: &[Vec<f64>]) {
    assert_eq!(points.len(), found.len());
    for (point, found) in points.iter().zip(found) {
        assert_all_near(found, &program.eval(point), F32, name);
    }
}

#[test]
fn the_catalog_covers_every_system_and_effect() {
    // 6 systems and 8 joints; 42 shapes (34 effects that are not for chains alone, 7 probes, one user effect) on each
    // joint, but no tilt on a second joint, no rotor in the pendulum, a coupling only in the acrobot, and on the two
    // joints that slide nothing that repeats with each turn, which three effects do.
    assert_eq!(
        catalog(SignForm::Exact).len(),
        6 + 8 * 42 - 2 - 1 - 7 - 2 * 3
    );
}
