use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Rollouts, Rows, W};
use crate::expr::SignForm;
use crate::lanes::Row;
use crate::model::{
    Angles, Dynamics, InputScaling, Integrator, LastLayer, Library, MlpSettings, MlpWeights,
    ResidualOn, with_residual,
};
use crate::plan::Objective;
use crate::plant::Environment;

const STEP_S: f64 = 0.02;
const STEPS: usize = 12;

fn equations(name: &str) -> Dynamics {
    let system = Library::built_in().system(Path::new(name)).unwrap();
    system.dynamics(&vec![SignForm::DEFAULT; system.joints])
}

fn network(joints: usize, angles: Angles, on: ResidualOn) -> MlpWeights {
    let settings = MlpSettings {
        angles,
        on,
        ..MlpSettings::for_joints(joints)
    };
    let features = angles.features(joints);
    let scaling = InputScaling {
        mean: (0..features).map(|k| 0.1 * k as f64).collect(),
        std: (0..features).map(|k| 1.0 + 0.5 * k as f64).collect(),
    };
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    MlpWeights::new(joints, &settings, scaling, LastLayer::Random, &mut rng)
}

/// The returns of one block by the engine, and one after the other in f64.
fn both(equations: &Dynamics, networks: &[MlpWeights], integrator: Integrator) -> [Vec<f64>; 2] {
    let n = equations.joints;
    let reward = "cos(q1) - 0.1 * tau1^2 + 0.01 * qd1 * t";
    let objective = Objective::new(reward, n).unwrap();
    let rollouts = Rollouts::new(equations, networks, objective.program(), integrator, STEP_S);
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let inputs: Vec<Rows> = (0..STEPS * n)
        .map(|_| Row(std::array::from_fn(|_| rng.random_range(-3.0..3.0))))
        .collect();
    let start: Vec<f32> = (0..2 * n).map(|k| 0.4 - 0.3 * k as f32).collect();
    let mut returns = Rows::splat(f32::NAN);
    rollouts
        .block()
        .returns(&start, 1.5, &[], &inputs, &mut returns);

    let whole = networks.iter().fold(equations.clone(), |sum, mlp| {
        with_residual(&sum, mlp).unwrap()
    });
    let values = whole.values();
    let exact = |lane: usize| {
        let mut model = Environment::new(&whole, &values, integrator, STEP_S);
        let mut state: Vec<f64> = start.iter().copied().map(f64::from).collect();
        let mut sum = 0.0;
        for step in 0..STEPS {
            let tau: Vec<f64> = (0..n)
                .map(|j| f64::from(inputs[step * n + j][lane]))
                .collect();
            let time_s = 1.5 + STEP_S * step as f64;
            model.step(&mut state, &tau, time_s);
            let seen = [&state, &tau, &vec![time_s + STEP_S]]
                .map(|x| x.as_slice())
                .concat();
            sum += objective.program().eval(&seen)[0];
        }
        sum
    };
    [
        returns.iter().copied().map(f64::from).collect(),
        (0..W).map(exact).collect(),
    ]
}

#[test]
fn a_block_returns_what_single_rollouts_in_f64_do() {
    let integrators = [
        Integrator::SemiImplicitEuler,
        Integrator::Rk4,
        Integrator::Fine {
            steps: 3.try_into().unwrap(),
        },
    ];
    for name in ["pendulum", "acrobot", "cartpole"] {
        let equations = equations(name);
        let mut networks = vec![Vec::new()];
        for angles in [Angles::Raw, Angles::SinCos] {
            for on in [ResidualOn::Accelerations, ResidualOn::Derivative] {
                networks.push(vec![network(equations.joints, angles, on)]);
            }
        }
        networks.push([networks[1].clone(), networks[4].clone()].concat());
        for (networks, integrator) in networks.iter().flat_map(|n| integrators.map(|i| (n, i))) {
            let [found, wanted] = both(&equations, networks, integrator);
            for (found, wanted) in found.iter().zip(&wanted) {
                // Twelve rewards of order one in f32.
                let off = (found - wanted).abs();
                assert!(
                    off < 2e-4,
                    "{found} or {wanted}: {name}, {integrator:?}, {}",
                    networks.len()
                );
            }
        }
    }
}

#[test]
fn a_rollout_that_diverges_does_so_alone_and_says_so() {
    let equations = equations("pendulum");
    let objective = Objective::new("cos(q1) - 1e30 * tau1^2", 1).unwrap();
    let rollouts = Rollouts::new(
        &equations,
        &[],
        objective.program(),
        Integrator::default(),
        STEP_S,
    );
    let mut inputs = vec![Rows::splat(0.5); STEPS];
    inputs[3][7] = 1e30;
    let mut returns = Rows::splat(0.0);
    rollouts
        .block()
        .returns(&[0.1, 0.0], 0.0, &[], &inputs, &mut returns);
    for (lane, value) in returns.iter().enumerate() {
        assert_eq!(value.is_finite(), lane != 7, "{lane}: {value}");
    }
}

#[test]
fn a_network_does_not_hide_what_is_not_a_number() {
    let equations = equations("pendulum");
    let objective = Objective::new("cos(q1)", 1).unwrap();
    let networks = [network(1, Angles::Raw, ResidualOn::Accelerations)];
    let rollouts = Rollouts::new(
        &equations,
        &networks,
        objective.program(),
        Integrator::default(),
        STEP_S,
    );
    let mut returns = Rows::splat(0.0);
    let start = [0.1, f32::NAN];
    rollouts
        .block()
        .returns(&start, 0.0, &[], &[Rows::splat(0.0); STEPS], &mut returns);
    assert!(returns.iter().all(|value| value.is_nan()), "{returns:?}");
}
