use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Rollouts, Rows, W};
use crate::data::Joint;
use crate::lanes::Row;
use crate::model::{
    Angles, Dynamics, FittedEffect, InputScaling, LastLayer, Library, MlpSettings, MlpWeights,
    ResidualOn, with_residual,
};
use crate::sim::{Commands, Environment, Hold, Integrator, Objective, RK4, Simulator};

const STEP_S: f64 = 0.02;
const STEPS: usize = 12;

fn equations(name: &str) -> Dynamics {
    let system = Library::built_in().model(name).unwrap();
    system.dynamics()
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

/// The returns of one block from the engine, and computed one by one in f64.
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
    let exact = |lane: usize| {
        let mut model = Environment::new(&whole, integrator, STEP_S);
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
    for name in ["pendulum", "acrobot", "cartpole"] {
        let equations = equations(name);
        let mut networks = vec![Vec::new()];
        for angles in [Angles::Raw, Angles::SinCos] {
            for on in [ResidualOn::Accelerations, ResidualOn::Derivative] {
                networks.push(vec![network(equations.joints, angles, on)]);
            }
        }
        networks.push([networks[1].clone(), networks[4].clone()].concat());
        let each = Integrator::each();
        for (networks, integrator) in networks
            .iter()
            .flat_map(|n| each.iter().map(move |i| (n, *i)))
        {
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

/// Effect, joint from 0, parameter in s.
type Filter = (&'static str, usize, f64);

/// A system with these filters.
fn filtered(name: &str, filters: &[Filter]) -> Dynamics {
    let library = Library::built_in();
    let system = library.model(name).unwrap();
    let effects: Vec<_> = filters
        .iter()
        .map(|(name, joint, value)| {
            let mut effect = FittedEffect::absent(library.effect(name).unwrap(), Joint::at(*joint));
            effect.values[0].0 = *value;
            effect
        })
        .collect();
    system.with_effects(effects).dynamics()
}

fn filtered_rollouts(equations: &Dynamics, objective: &Objective) -> Rollouts {
    Rollouts::new(equations, &[], objective.program(), Integrator::RK4, STEP_S)
}

#[test]
fn torques_are_filtered_as_everywhere_else() {
    let cases: [(&str, &[Filter]); 4] = [
        ("pendulum", &[("actuator_delay", 0, 1.5 * STEP_S)]),
        ("pendulum", &[("actuator_lag", 0, 0.05)]),
        ("acrobot", &[("actuator_lag", 1, 0.03)]),
        (
            "acrobot",
            &[
                ("actuator_delay", 0, 0.013),
                ("actuator_lag", 0, 0.02),
                ("actuator_delay", 1, 0.07),
            ],
        ),
    ];
    for (name, filters) in cases {
        let model = filtered(name, filters);
        let n = model.joints;
        let objective = Objective::new("cos(q1) - 0.1 * tau1^2", n).unwrap();
        let rollouts = filtered_rollouts(&model, &objective);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut draw = |steps: usize| -> Vec<Vec<f64>> {
            let mut step = || (0..n).map(|_| rng.random_range(-3.0..3.0)).collect();
            (0..steps).map(|_| step()).collect()
        };
        let inputs = draw(STEPS);
        for past in [vec![], draw(1), draw(4), draw(200)] {
            let start: Vec<f64> = (0..2 * n).map(|k| 0.4 - 0.3 * k as f64).collect();
            let mut found = Rows::splat(f32::NAN);
            let rows: Vec<_> = inputs
                .iter()
                .flatten()
                .map(|x| Rows::splat(*x as f32))
                .collect();
            let begin: Vec<f32> = start.iter().map(|x| *x as f32).collect();
            let carried = rollouts.carried(&past, STEPS);
            rollouts
                .block()
                .returns(&begin, 0.0, &carried, &rows, &mut found);
            let wanted = filtered_return(&model, &objective, &start, &past, &inputs);
            for found in found.iter() {
                let off = (f64::from(*found) - wanted).abs();
                assert!(
                    off < 2e-4,
                    "{found} or {wanted}: {filters:?} after {}",
                    past.len()
                );
            }
        }
    }
}

/// The return of one sequence in f64, with the acting torques from [`Commands`].
fn filtered_return(
    model: &Dynamics,
    objective: &Objective,
    start: &[f64],
    past: &[Vec<f64>],
    inputs: &[Vec<f64>],
) -> f64 {
    let at_rest = vec![0.0; model.joints];
    let past = if past.is_empty() { &[at_rest] } else { past };
    let rows = [past, inputs].concat();
    let time: Vec<f64> = (0..=rows.len())
        .map(|row| STEP_S * (row as f64 - past.len() as f64))
        .collect();
    let tau: Vec<Vec<f64>> = (0..model.joints)
        .map(|joint| rows.iter().map(|tau| tau[joint]).collect())
        .collect();
    let commands = Commands::new(model, &time[..rows.len()], &tau);
    let mut simulator = Simulator::new(model, RK4);
    simulator.put(start);
    let mut sum = 0.0;
    for row in past.len()..rows.len() {
        let held: Vec<_> = rows[row].iter().map(|x| Row([*x])).collect();
        let [from, to] = [row, row + 1].map(|row| Row([time[row]]));
        simulator.advance(&Hold::lasting([&commands], &held, from, STEP_S, 1));
        let seen = [simulator.state.as_slice(), &held, &[to]].concat();
        let seen: Vec<f64> = seen.iter().map(|row| row[0]).collect();
        sum += objective.program().eval(&seen)[0];
    }
    sum
}

#[test]
fn what_lies_beyond_the_memory_does_not_matter() {
    let objective = Objective::new("cos(q1)", 1).unwrap();
    let memory =
        |filters: &[Filter]| filtered_rollouts(&filtered("pendulum", filters), &objective).memory();
    assert_eq!(memory(&[]), 0);
    assert_eq!(memory(&[("actuator_delay", 0, 0.0)]), 0);
    assert_eq!(memory(&[("actuator_delay", 0, 1.5 * STEP_S)]), 2);
    let lag = filtered("pendulum", &[("actuator_lag", 0, 0.05)]);
    let rollouts = filtered_rollouts(&lag, &objective);
    let past: Vec<_> = (0..100).map(|k| vec![f64::from(k).sin()]).collect();
    let recent = &past[past.len() - rollouts.memory()..];
    assert_eq!(
        rollouts.carried(&past, STEPS),
        rollouts.carried(recent, STEPS)
    );
    let forgotten = &recent[1..];
    assert_ne!(
        rollouts.carried(&past, STEPS),
        rollouts.carried(forgotten, STEPS)
    );
    // However slow, a filter passes a constant torque in full.
    let slow = filtered("pendulum", &[("actuator_lag", 0, 1000.0)]);
    let carried = filtered_rollouts(&slow, &objective).carried(&[vec![1.0]], 1);
    assert!((carried[0] - 1.0).abs() < 1e-4, "{carried:?}");
}
