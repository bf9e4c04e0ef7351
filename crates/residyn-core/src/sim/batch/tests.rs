use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Rollouts, Rows, W};
use crate::data::Joint;
use crate::lanes::Row;
use crate::model::{
    Angles, Dynamics, FittedEffect, InputScaling, LastLayer, Library, MlpSettings, MlpWeights,
    ResidualOn, with_residual,
};
use crate::sim::{Environment, Integrator, Objective};

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

/// The objective and rollouts of a model for it.
fn rollouts(
    equations: &Dynamics,
    networks: &[MlpWeights],
    reward: &str,
    integrator: Integrator,
) -> (Objective, Rollouts) {
    let objective = Objective::new(reward, equations.joints).unwrap();
    let program = objective.program();
    let rollouts = Rollouts::new(equations, networks, program, integrator, STEP_S);
    (objective, rollouts)
}

/// The returns of one block of `rollouts`.
fn returns(
    rollouts: &Rollouts,
    start: &[f64],
    begin_s: f32,
    carried: &[f32],
    inputs: &[Rows],
) -> Rows {
    let start: Vec<f32> = start.iter().map(|x| *x as f32).collect();
    let mut returns = Rows::splat(f32::NAN);
    rollouts
        .block()
        .returns(&start, begin_s, carried, inputs, &mut returns);
    returns
}

/// The return of one sequence in f64. The oldest of the torques `past` was held for ever before.
fn exact(
    (model, integrator): (&Dynamics, Integrator),
    objective: &Objective,
    start: &[f64],
    begin_s: f64,
    past: &[Vec<f64>],
    inputs: &[Vec<f64>],
) -> f64 {
    let mut rig = Environment::new(model, integrator, STEP_S);
    // The memory of the filters here is shorter.
    let oldest = past.iter().take(1).cycle().take(200);
    let before: Vec<&Vec<f64>> = oldest.chain(past).collect();
    for (step, tau) in before.iter().enumerate() {
        let ago = before.len() - step;
        rig.step(&mut start.to_vec(), tau, begin_s - STEP_S * ago as f64);
    }
    let (mut state, mut sum) = (start.to_vec(), 0.0);
    for (step, tau) in inputs.iter().enumerate() {
        let time_s = begin_s + STEP_S * step as f64;
        rig.step(&mut state, tau, time_s);
        sum += objective.value(&state[..2 * model.joints], tau, time_s + STEP_S);
    }
    sum
}

/// Where the rollouts of a system with `joints` joints start: positions, then velocities.
fn start(joints: usize) -> Vec<f64> {
    (0..2 * joints)
        .map(|k| f64::from(0.4 - 0.3 * k as f32))
        .collect()
}

/// The returns of one block from the engine, and computed one by one in f64.
fn both(equations: &Dynamics, networks: &[MlpWeights], integrator: Integrator) -> [Vec<f64>; 2] {
    let n = equations.joints;
    let reward = "cos(q1) - 0.1 * tau1^2 + 0.01 * qd1 * t";
    let (objective, rollouts) = rollouts(equations, networks, reward, integrator);
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let inputs: Vec<Rows> = (0..STEPS * n)
        .map(|_| Row::from_fn(|_| rng.random_range(-3.0..3.0)))
        .collect();
    let internal = equations.internal_starts(&equations.values());
    let start = [start(n), internal].concat();
    let found = returns(&rollouts, &start, 1.5, &[], &inputs);
    let whole = networks.iter().fold(equations.clone(), |sum, mlp| {
        with_residual(&sum, mlp).unwrap()
    });
    let exact = |lane: usize| {
        let of_step = |step: &[Rows]| step.iter().map(|row| f64::from(row[lane])).collect();
        let inputs: Vec<Vec<f64>> = inputs.chunks(n).map(of_step).collect();
        exact((&whole, integrator), &objective, &start, 1.5, &[], &inputs)
    };
    [
        found.iter().copied().map(f64::from).collect(),
        (0..W).map(exact).collect(),
    ]
}

#[test]
fn a_block_moves_the_states_of_effects() {
    let library = Library::built_in();
    let on = |name: &str, values: &[f64]| {
        let mut own = FittedEffect::absent(library.effect(name).unwrap(), Joint::at(0));
        own.values = values.iter().map(|value| (*value, None)).collect();
        own
    };
    let effects = vec![
        on("joint_elasticity", &[60.0, 0.2, 0.02, 0.0, 1.0]),
        on("presliding", &[0.12, 5.0]),
    ];
    let system = library.model("pendulum").unwrap().with_effects(effects);
    for integrator in Integrator::each() {
        let [found, exact] = both(&system.dynamics(), &[], integrator);
        for (found, exact) in found.iter().zip(&exact) {
            let off = (found - exact).abs();
            assert!(off < 1e-3 * exact.abs().max(1.0), "{found} {exact}");
        }
    }
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
    let reward = "cos(q1) - 1e30 * tau1^2";
    let (_, rollouts) = rollouts(&equations, &[], reward, Integrator::default());
    let mut inputs = vec![Rows::splat(0.5); STEPS];
    inputs[3][7] = 1e30;
    let returns = returns(&rollouts, &[0.1, 0.0], 0.0, &[], &inputs);
    for (lane, value) in returns.iter().enumerate() {
        assert_eq!(value.is_finite(), lane != 7, "{lane}: {value}");
    }
}

#[test]
fn a_network_does_not_hide_what_is_not_a_number() {
    let equations = equations("pendulum");
    let networks = [network(1, Angles::Raw, ResidualOn::Accelerations)];
    let (_, rollouts) = rollouts(&equations, &networks, "cos(q1)", Integrator::default());
    let inputs = [Rows::splat(0.0); STEPS];
    let returns = returns(&rollouts, &[0.1, f64::NAN], 0.0, &[], &inputs);
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
        let reward = "cos(q1) - 0.1 * tau1^2";
        let (objective, rollouts) = rollouts(&model, &[], reward, Integrator::RK4);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut draw = |steps: usize| -> Vec<Vec<f64>> {
            let mut step = || (0..n).map(|_| rng.random_range(-3.0..3.0)).collect();
            (0..steps).map(|_| step()).collect()
        };
        let inputs = draw(STEPS);
        for past in [vec![], draw(1), draw(4), draw(200)] {
            let rows: Vec<_> = (inputs.iter().flatten())
                .map(|x| Rows::splat(*x as f32))
                .collect();
            let carried = rollouts.carried(&past, STEPS);
            let found = returns(&rollouts, &start(n), 0.0, &carried, &rows);
            let model = (&model, Integrator::RK4);
            let wanted = exact(model, &objective, &start(n), 0.0, &past, &inputs);
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

#[test]
fn what_lies_beyond_the_memory_does_not_matter() {
    let of = |filters: &[Filter]| {
        rollouts(
            &filtered("pendulum", filters),
            &[],
            "cos(q1)",
            Integrator::RK4,
        )
        .1
    };
    let memory = |filters: &[Filter]| of(filters).memory();
    assert_eq!(memory(&[]), 0);
    assert_eq!(memory(&[("actuator_delay", 0, 0.0)]), 0);
    assert_eq!(memory(&[("actuator_delay", 0, 1.5 * STEP_S)]), 2);
    let rollouts = of(&[("actuator_lag", 0, 0.05)]);
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
    let carried = of(&[("actuator_lag", 0, 1000.0)]).carried(&[vec![1.0]], 1);
    assert!((carried[0] - 1.0).abs() < 1e-4, "{carried:?}");
}

#[test]
fn torques_that_act_later_move_a_model_as_torques_given_later_do() {
    let (equations, integrator) = (equations("acrobot"), Integrator::default());
    let (objective, at_once) = rollouts(&equations, &[], "cos(q1) + 0.01 * qd2 * t", integrator);
    let later = at_once.acting_after(2);
    assert_eq!(later.memory(), 2);
    let past = [vec![1.0, -0.5], vec![-2.0, 0.3]];
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let given: Vec<Vec<f64>> = (0..STEPS)
        .map(|_| vec![rng.random_range(-3.0..3.0), rng.random_range(-3.0..3.0)])
        .collect();
    let inputs = given.iter().flatten();
    let inputs: Vec<Rows> = inputs.map(|tau| Row::from_fn(|_| *tau as f32)).collect();
    let start = start(2);
    let found = returns(&later, &start, 1.5, &later.carried(&past, STEPS), &inputs);
    let acting = [&past, &given[..STEPS - 2]].concat();
    let model = (&equations, integrator);
    let exact = exact(model, &objective, &start, 1.5, &[], &acting);
    assert!(
        (f64::from(found[0]) - exact).abs() < 1e-4 * exact.abs(),
        "{found:?} {exact}"
    );
}
