use burn::module::Module;
use burn::tensor::{Tensor, TensorData};
use rand::RngExt;

use super::{hybrid_of, pendulum, rng, transitions};
use crate::{Backend, HybridModel};
use residyn_core::expr::Program;
use residyn_core::lanes::Row;
use residyn_core::model::{
    Angles, Dynamics, InputScaling, LastLayer, Library, MlpSettings, MlpWeights, ResidualOn,
    with_residual,
};

const ROWS: usize = 37;

/// Random points: states `[q, qd]`, inputs and times.
fn points() -> [[f64; 4]; ROWS] {
    let mut rng = rng(11);
    let mut one = |bound: f64| f64::from(rng.random_range(-bound..bound) as f32);
    [(); ROWS].map(|()| [one(3.0), one(8.0), one(3.0), one(1.0)])
}

/// Rates `[row][state]` at rows `[states, inputs, time]`.
fn derivative<const N: usize>(model: &HybridModel, rows: &[[f32; N]]) -> Vec<f64> {
    let states = 2 * model.joints();
    let column = |k: usize| {
        let values: Vec<f32> = rows.iter().map(|row| row[k]).collect();
        Tensor::<1>::from_data(TensorData::new(values, [rows.len()]), &model.device())
    };
    let columns: Vec<Tensor<1>> = (0..N).map(column).collect();
    let (state, input) = columns[..N - 1].split_at(states);
    let derivative = model
        .unpack()
        .derivative(state, input, &columns[N - 1], [state, &[]]);
    let residual = model.structure().networks.last();
    if let (Some(found), Some(made)) = (derivative.residual, residual) {
        assert_eq!(found.dims(), [rows.len(), made.on.outputs(model.joints())]);
    }
    let rates = derivative.rates.into_iter();
    let rates = rates.map(|rate| rate.expand([rows.len()])).collect();
    let rates: Tensor<2> = Tensor::stack(rates, 1);
    assert_eq!(rates.dims(), [rows.len(), states]);
    rates.into_data().iter::<f32>().map(f64::from).collect()
}

fn tensors(model: &HybridModel) -> Vec<f64> {
    derivative(model, &points().map(|point| point.map(|x| x as f32)))
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
            networks.push(segments.network(&settings, LastLayer::Random, &mut rng(7)));
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
fn tensors_lanes_and_the_exported_program_agree() {
    // Sums of 16 products of order one in f32, four layers deep: a few 1e-6.
    for (backend, mlp) in Backend::ALL
        .iter()
        .flat_map(|b| networks().into_iter().map(|m| (*b, m)))
    {
        let device = backend.device();
        let hybrid = hybrid_of(&pendulum(15.0, 3.0), &mlp, &device);
        let alone = HybridModel::network("pendulum", 1, &mlp, &device).unwrap();
        for model in [hybrid, alone] {
            let dynamics = model.to_dynamics().unwrap();
            let exact = numbers(&dynamics);
            assert_close(&tensors(&model), &exact, 1e-5);
            assert_close(&tensors(&model.valid()), &exact, 1e-5);
            assert_close(&lanes(&dynamics.program, &dynamics.values()), &exact, 1e-5);
        }
    }
}

#[test]
fn tensors_and_the_exported_program_of_two_joints_agree() {
    let acrobot = Library::built_in().model("acrobot").unwrap();
    let acrobot = acrobot.with_smoothing_velocities(vec![0.0; 2]).dynamics();
    let mut rng = rng(12);
    // Positions, velocities, inputs and time of each row.
    let rows = [(); ROWS].map(|()| [(); 7].map(|()| rng.random_range(-3.0f32..3.0)));
    for on in [ResidualOn::Accelerations, ResidualOn::Derivative] {
        let settings = MlpSettings {
            on,
            angles: Angles::SinCos,
            ..MlpSettings::for_joints(2)
        };
        let scaling = InputScaling::identity(8);
        let mlp = MlpWeights::new(2, &settings, scaling, LastLayer::Random, &mut rng);
        let device = Backend::NdArray.device();
        let model = hybrid_of(&acrobot, &mlp, &device);
        let found = derivative(&model, &rows);
        let written = model.to_dynamics().unwrap();
        let exact = rows.iter().flat_map(|row| {
            let point = row.iter().copied().map(f64::from);
            let inputs: Vec<f64> = point.chain(written.values()).collect();
            written.program.eval(&inputs)
        });
        assert_close(&found, &exact.collect::<Vec<_>>(), 1e-4);
    }
}

#[test]
fn a_model_returns_the_weights_that_it_was_made_of() {
    for (backend, mlp) in Backend::ALL
        .iter()
        .flat_map(|b| networks().into_iter().map(|m| (*b, m)))
    {
        let model = hybrid_of(&pendulum(15.0, 3.0), &mlp, &backend.device());
        let weights = model.weights();
        assert_eq!(weights.residual.as_ref(), Some(&mlp));
        assert_eq!(model.with_weights(&weights).unwrap().weights(), weights);
        assert_eq!(model.parameters()[1], ("C_i".to_owned(), 3.0));
    }
}

#[test]
fn a_residual_of_zero_changes_no_bit_of_the_rates() {
    let settings = MlpSettings::for_joints(1);
    let mlp = transitions(50, 0.0, 1).network(&settings, LastLayer::Zero, &mut rng(7));
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
         features, end with 2 outputs and have no empty layer; change `hidden`, or use the network that was \
         trained for this system"
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
