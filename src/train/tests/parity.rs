use std::path::Path;

use burn::module::Module;
use burn::tensor::{Tensor, TensorData};
use rand::RngExt;

use super::{pendulum, rng, transitions};
use crate::expr::Program;
use crate::lanes::Row;
use crate::model::{
    Angles, Dynamics, InputScaling, LastLayer, Library, MlpSettings, MlpWeights, ResidualOn,
    with_residual,
};
use crate::train::{Backend, HybridModel};

const ROWS: usize = 37;

/// Random points: states `[q, qd]`, inputs and times.
fn points() -> Vec<[f64; 4]> {
    let mut rng = rng(11);
    let mut one = |bound: f64| f64::from(rng.random_range(-bound..bound) as f32);
    (0..ROWS)
        .map(|_| [one(3.0), one(8.0), one(3.0), one(1.0)])
        .collect()
}

fn tensors(model: &HybridModel) -> Vec<f64> {
    let device = model.device();
    let column = |k: usize| points().iter().map(|p| p[k] as f32).collect::<Vec<f32>>();
    let matrix = |columns: &[usize]| {
        let stacked: Vec<Tensor<1>> = (columns.iter())
            .map(|k| Tensor::from_data(TensorData::new(column(*k), [ROWS]), &device))
            .collect();
        Tensor::stack::<2>(stacked, 1)
    };
    let time = Tensor::from_data(TensorData::new(column(3), [ROWS]), &device);
    let (rates, _) = model.derivative(matrix(&[0, 1]), matrix(&[2]), &time);
    assert_eq!(rates.dims(), [ROWS, 2]);
    rates.into_data().iter::<f32>().map(f64::from).collect()
}

fn numbers(dynamics: &Dynamics) -> Vec<f64> {
    let row = |point: &[f64; 4]| {
        let inputs: Vec<f64> = point.iter().copied().chain(dynamics.values()).collect();
        dynamics.program.eval(&inputs)
    };
    points().iter().flat_map(row).collect()
}

fn lanes(program: &Program, parameters: &[f64]) -> Vec<f64> {
    let mut tape = program.tape::<f32, 1>();
    let row = |point: &[f64; 4]| {
        let inputs = point.iter().chain(parameters);
        for (slot, value) in tape.inputs().iter_mut().zip(inputs) {
            *slot = Row([*value as f32]);
        }
        tape.run();
        [f64::from(tape.output(0)[0]), f64::from(tape.output(1)[0])]
    };
    points().iter().flat_map(row).collect()
}

fn networks() -> Vec<MlpWeights> {
    let segments = transitions(50, 0.0, 1);
    let mut networks = Vec::new();
    for angles in [Angles::Raw, Angles::SinCos] {
        for on in [ResidualOn::Accelerations, ResidualOn::Derivative] {
            let settings = MlpSettings {
                hidden: vec![16; 3],
                angles,
                on,
            };
            let scaling = segments.scaling(angles);
            networks.push(MlpWeights::new(
                1,
                &settings,
                scaling,
                LastLayer::Random,
                &mut rng(7),
            ));
        }
    }
    networks
}

fn assert_close(found: &[f64], wanted: &[f64], tolerance: f64) {
    for (found, wanted) in found.iter().zip(wanted) {
        let off = (found - wanted).abs();
        assert!(
            off <= tolerance * (1.0 + wanted.abs()),
            "{found} or {wanted}"
        );
    }
}

#[test]
fn tensors_and_the_written_out_program_agree() {
    // Sums of 16 products of order one in f32, four layers deep: a few 1e-6.
    for (backend, mlp) in Backend::ALL
        .iter()
        .flat_map(|b| networks().into_iter().map(|m| (*b, m)))
    {
        let device = backend.device();
        let hybrid = HybridModel::physics(&pendulum(15.0, 3.0), &device)
            .and_then(|model| model.with_residual(&mlp))
            .unwrap();
        let alone = HybridModel::network("pendulum", 1, &mlp, &device).unwrap();
        for model in [hybrid, alone] {
            let dynamics = model.to_dynamics().unwrap();
            let exact = numbers(&dynamics);
            assert_close(&tensors(&model), &exact, 1e-5);
            assert_close(&tensors(&model.clone().valid()), &exact, 1e-5);
            assert_close(&lanes(&dynamics.program, &dynamics.values()), &exact, 1e-5);
        }
    }
}

#[test]
fn two_joints_agree_too() {
    let acrobot = Library::built_in().model(Path::new("acrobot")).unwrap();
    let acrobot = acrobot.with_sign_widths(vec![0.0; 2]).dynamics();
    let mut rng = rng(12);
    // Positions, velocities, inputs of each row.
    let rows: Vec<[f32; 6]> = (0..ROWS)
        .map(|_| [0; 6].map(|_| rng.random_range(-3.0..3.0)))
        .collect();
    for on in [ResidualOn::Accelerations, ResidualOn::Derivative] {
        let settings = MlpSettings {
            on,
            angles: Angles::SinCos,
            ..MlpSettings::for_joints(2)
        };
        let scaling = InputScaling::identity(8);
        let mlp = MlpWeights::new(2, &settings, scaling, LastLayer::Random, &mut rng);
        let device = Backend::NdArray.device();
        let model = HybridModel::physics(&acrobot, &device)
            .and_then(|model| model.with_residual(&mlp))
            .unwrap();
        let data = TensorData::new(rows.concat(), [ROWS, 6]);
        let all: Tensor<2> = Tensor::from_data(data, &device);
        let (state, input) = (all.clone().narrow(1, 0, 4), all.narrow(1, 4, 2));
        let (rates, residual) = model.derivative(state, input, &Tensor::zeros([ROWS], &device));
        assert_eq!(residual.unwrap().dims(), [ROWS, on.outputs(2)]);
        let found: Vec<f64> = rates.into_data().iter::<f32>().map(f64::from).collect();
        let written = model.to_dynamics().unwrap();
        let exact = rows.iter().flat_map(|row| {
            let point = row.iter().copied().map(f64::from).chain([0.0]);
            let inputs: Vec<f64> = point.chain(written.values()).collect();
            written.program.eval(&inputs)
        });
        assert_close(&found, &exact.collect::<Vec<_>>(), 1e-4);
    }
}

#[test]
fn numbers_survive_the_way_through_the_module() {
    for (backend, mlp) in Backend::ALL
        .iter()
        .flat_map(|b| networks().into_iter().map(|m| (*b, m)))
    {
        let model = HybridModel::physics(&pendulum(15.0, 3.0), &backend.device())
            .and_then(|model| model.with_residual(&mlp))
            .unwrap();
        let weights = model.weights();
        assert_eq!(weights.residual.as_ref(), Some(&mlp));
        assert_eq!(model.with_weights(&weights).unwrap().weights(), weights);
        assert_eq!(model.parameters()[1], ("C_i".to_owned(), 3.0));
    }
}

#[test]
fn a_new_residual_changes_nothing_to_the_last_bit() {
    let settings = MlpSettings::for_joints(1);
    let scaling = transitions(50, 0.0, 1).scaling(Angles::Raw);
    let mlp = MlpWeights::new(1, &settings, scaling, LastLayer::Zero, &mut rng(7));
    let physics = pendulum(14.3, 2.9);
    assert_eq!(with_residual(&physics, &mlp).unwrap(), physics);
    for backend in Backend::ALL {
        let alone = HybridModel::physics(&physics, &backend.device()).unwrap();
        let hybrid = alone.clone().with_residual(&mlp).unwrap();
        assert_eq!(tensors(&hybrid), tensors(&alone));
    }
}

#[test]
fn networks_of_another_shape_are_refused() {
    let mlp = &networks()[0];
    let device = Backend::NdArray.device();
    let message = HybridModel::network("arm", 2, mlp, &device)
        .unwrap_err()
        .to_string();
    assert_eq!(
        message,
        "a network with layer widths [3, 16, 16, 16, 1] does not fit 2 joints: it must begin with 6 \
         features, end with 2 outputs and have no empty layer; change `hidden`, or take the network that \
         was trained for this system"
    );
    let mut dynamics = pendulum(15.0, 3.0);
    dynamics.parameters[1].scale = 0.0;
    let error = HybridModel::physics(&dynamics, &Backend::NdArray.device()).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("parameter `C_i` has value 3, scale 0, bounds [-inf, inf]")
    );
}
