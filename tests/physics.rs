//! Balances that every motion satisfies, and the order of the integrator.

use std::path::Path;

use residyn_core::expr::{Program, SignForm};
use residyn_core::lanes::Row;
use residyn_core::model::{Dynamics, Model};
use residyn_core::sim::{RK4, SCHEMES, Scheme, Stepper};

use crate::support::catalogue::{all_systems, assert_energy_balanced, dynamics, points, system};

/// A system that states its energy, ready to run.
struct Balanced {
    model: Dynamics,
    /// `[total, power, d total / d state..]`
    energy: Program,
}

impl Balanced {
    fn new(system: &Model) -> Self {
        Self {
            model: dynamics(system, &[], SignForm::Exact),
            energy: system.energy_program().expect("the file states an energy"),
        }
    }

    fn energy(&self, state: &[Row<f64, 1>], tau: &[Row<f64, 1>]) -> [f64; 2] {
        let moving = state.iter().chain(tau).map(|value| value[0]);
        let inputs: Vec<f64> = moving.chain([0.0]).chain(self.model.values()).collect();
        let found = self.energy.eval(&inputs);
        [found[0], found[1]]
    }
}

#[test]
fn energy_changes_by_the_power_at_every_point() {
    for system in all_systems() {
        let Balanced { model, energy } = Balanced::new(&system);
        let points = points(&model, 500, 2);
        // Rounding of the terms that cancel.
        assert_energy_balanced(&model, &energy, &points, 1e-13);
    }
}

/// Time for which a torque is held, in s.
const HOLD_S: f64 = 0.02;
/// Integration steps per hold: 0.1 ms, whose fourth-order error is below rounding.
const STEPS: usize = 200;

/// Change of energy minus work in J over 5 s from rest near zero, under torques of up to 3 N m.
fn imbalance(system: &Model) -> f64 {
    let balanced = Balanced::new(system);
    let n = system.joints;
    let mut stepper = Stepper::<1>::new(&balanced.model, RK4);
    let mut state = vec![Row([0.3]); n];
    state.extend(vec![Row([0.0]); n]);
    let h = HOLD_S / STEPS as f64;
    let start = balanced.energy(&state, &vec![Row([0.0]); n])[0];
    let mut work = 0.0;
    for hold in 0..250 {
        let time = HOLD_S * f64::from(hold);
        let tau: Vec<Row<f64, 1>> = (0..n)
            .map(|j| Row([3.0 * (2.0 * time + 1.5 * j as f64).sin()]))
            .collect();
        for _ in 0..STEPS {
            // Simpson's rule on both ends and the middle: of order 4, as is the motion.
            let before = balanced.energy(&state, &tau)[1];
            stepper.advance(&mut state, &tau, Row([time]), Row([h / 2.0]), 1);
            let middle = balanced.energy(&state, &tau)[1];
            stepper.advance(&mut state, &tau, Row([time]), Row([h / 2.0]), 1);
            let after = balanced.energy(&state, &tau)[1];
            work += h / 6.0 * (before + 4.0 * middle + after);
        }
    }
    balanced.energy(&state, &vec![Row([0.0]); n])[0] - start - work
}

#[test]
fn energy_minus_work_is_constant_over_five_seconds() {
    for mut system in all_systems() {
        // At a drive's limit, Simpson's rule is of first order.
        let limits = system.parameters.iter_mut().filter(|p| p.name == "limit");
        limits.for_each(|limit| limit.value = 1e9);
        let off = imbalance(&system);
        // 50 000 sums whose rounding (1e-16 of some tens of J) walks at random. Measured: pendulum 4e-12,
        // drive 1.5e-12, cartpole 5e-13, acrobot 3e-13 J.
        assert!(off.abs() < 2e-11, "{}: {off:e} J", system.name);
    }
}

#[test]
fn the_acrobot_as_printed_violates_the_energy_balance() {
    let text = include_str!("fixtures/acrobot_as_printed.toml");
    let printed = Model::from_text(Path::new("acrobot_as_printed.toml"), text, &[]).unwrap();
    let off = imbalance(&printed);
    // Measured 3.2 J for a motion between -15 and 21 J; other torques dissipate other amounts.
    assert!(off.abs() > 1.0, "{off} J");
}

/// The pendulum's state after 1 s in `steps` steps of a scheme.
fn swung(scheme: &'static Scheme, steps: usize) -> [f64; 2] {
    let model = dynamics(&system("pendulum"), &[], SignForm::Exact);
    let mut stepper = Stepper::<1>::new(&model, scheme);
    let mut state = [Row([1.0]), Row([0.5])];
    stepper.advance(&mut state, &[Row([0.7])], Row([0.0]), Row([1.0]), steps);
    state.map(|value| value[0])
}

#[test]
fn each_scheme_converges_with_its_order() {
    // The fourth-order error at 2^-12 s is 2^-20 of that at 2^-7 s: negligible.
    let truth = swung(RK4, 4096);
    for scheme in SCHEMES {
        let error = |steps| {
            let found = swung(scheme, steps);
            (found[0] - truth[0]).hypot(found[1] - truth[1])
        };
        for steps in [64, 128] {
            let order = (error(steps) / error(2 * steps)).log2();
            let off = order - f64::from(scheme.order);
            // The next term of the error is of relative order h, a few percent here.
            assert!(
                off.abs() < 0.2,
                "{} has order {order} at {steps} steps",
                scheme.name
            );
        }
    }
}

#[test]
fn lanes_with_different_steps_are_independent() {
    let model = dynamics(&system("acrobot"), &[], SignForm::Exact);
    let lane = |l: usize| [0.2 * l as f64, 1.0 - 0.1 * l as f64, 0.3, -0.5 * l as f64];
    let (tau, dt) = (
        |l: usize| [1.0 - l as f64, 0.5 * l as f64],
        |l: usize| 0.01 * l as f64,
    );
    let mut together: Vec<Row<f64, 4>> = (0..4)
        .map(|k| Row(std::array::from_fn(|l| lane(l)[k])))
        .collect();
    let taus: Vec<Row<f64, 4>> = (0..2)
        .map(|j| Row(std::array::from_fn(|l| tau(l)[j])))
        .collect();
    let mut stepper = Stepper::<4>::new(&model, RK4);
    stepper.advance(
        &mut together,
        &taus,
        Row([0.0; 4]),
        Row(std::array::from_fn(dt)),
        3,
    );
    for l in 0..4 {
        let mut alone = lane(l).map(|x| Row([x]));
        let mut stepper = Stepper::<1>::new(&model, RK4);
        stepper.advance(
            &mut alone,
            &tau(l).map(|x| Row([x])),
            Row([0.0]),
            Row([dt(l)]),
            3,
        );
        let found: Vec<Row<f64, 1>> = together.iter().map(|lanes| Row([lanes[l]])).collect();
        assert_eq!(found, alone);
    }
}

#[test]
fn rollouts_pass_the_time_to_the_equations() {
    // qdd = t from rest: v = t^2 / 2, q = t^3 / 6, which a fourth-order method integrates exactly.
    let text = "[system]\nname = \"clock\"\njoints = 1\n[dynamics]\nqdd1 = \"t\"\n";
    let clock = Model::from_text(Path::new("clock.toml"), text, &[]).unwrap();
    let model = dynamics(&clock, &[], SignForm::Exact);
    let mut state = [Row([0.0]), Row([0.0])];
    let mut stepper = Stepper::<1>::new(&model, RK4);
    stepper.advance(&mut state, &[Row([0.0])], Row([0.0]), Row([1.5]), 3);
    stepper.advance(&mut state, &[Row([0.0])], Row([1.5]), Row([0.5]), 1);
    assert!((state[0][0] - 8.0 / 6.0).abs() < 1e-14);
    assert!((state[1][0] - 2.0).abs() < 1e-14);
}
