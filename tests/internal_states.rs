//! Effects with states of their own: how the states move, what the joint feels of them, and what of their files is refused.

use std::path::Path;

use residyn_core::data::{Joint, Quantity};
use residyn_core::expr::SignForm;
use residyn_core::model::{Dynamics, Effect, FittedEffect, Library};
use residyn_core::sim::{Environment, Integrator};

use crate::support::Scratch;
use crate::support::catalogue::{assert_near, dynamics, effect, system};
use crate::support::reports::{error, estimate, names};

/// A mass of 1 with these effects: acceleration is torque plus force.
fn drive(effects: &[FittedEffect]) -> Dynamics {
    dynamics(&system("drive"), effects, SignForm::Exact)
}

/// The force on the mass, and the rates of the internal states, at this speed without a torque.
fn at(model: &Dynamics, q: f64, v: f64, states: &[f64]) -> (f64, Vec<f64>) {
    let inputs = [
        &[q, v],
        states,
        &[0.0, 0.0],
        states,
        &[0.0],
        &model.values(),
    ];
    let out = model.program.eval(&inputs.concat());
    assert_eq!(out[0], v);
    (out[1], out[2..].to_vec())
}

#[test]
fn bristles_bend_before_they_slip() {
    let model = drive(&[effect("presliding", 0, &[0.4, 20.0])]);
    for (z, v) in [
        (0.0, 0.5),
        (0.01, 0.5),
        (0.01, -0.5),
        (-0.02, 2.0),
        (0.02, 2.0),
    ] {
        let (force, rates) = at(&model, 0.3, v, &[z]);
        assert_near(force, -20.0 * z, 1e-12, "force");
        assert_near(rates[0], v - v.abs() * 20.0 * z / 0.4, 1e-12, "rate");
    }
}

#[test]
fn a_cable_is_a_spring_with_a_loop() {
    let model = drive(&[effect("cable_hysteresis", 0, &[0.3, 0.2, 0.5])]);
    for (q, v, z) in [(0.7, 0.5, 0.4), (-0.7, -0.5, 0.4), (0.2, 0.1, -1.0)] {
        let (force, rates) = at(&model, q, v, &[z]);
        assert_near(force, -0.3 * q - 0.2 * z, 1e-12, "force");
        assert_near(rates[0], (v - v.abs() * z) / 0.5, 1e-12, "rate");
    }
}

#[test]
fn warmth_changes_friction_and_nothing_else() {
    let others = [
        effect("coulomb_friction", 0, &[0.4]),
        effect("viscous_friction", 0, &[0.1]),
        effect("joint_spring", 0, &[0.5, 0.2]),
    ];
    let warming = effect("thermal_friction", 0, &[0.3, 8.0]);
    for place in 0..=others.len() {
        let mut effects = others.to_vec();
        effects.insert(place, warming.clone());
        let model = drive(&effects);
        for (v, w) in [(0.5, 0.0), (-0.5, 0.6), (2.0, 1.0)] {
            let (force, rates) = at(&model, 0.7, v, &[w]);
            let friction = 0.4 * v.signum() + 0.1 * v;
            let wanted = -friction * (1.0 - 0.3 * w) - 0.5 * (0.7 - 0.2);
            assert_near(force, wanted, 1e-12, "force");
            assert_near(rates[0], (1.0 - w) / 8.0, 1e-12, "rate");
        }
    }
}

#[test]
fn damped_bristles_hold_more_near_standstill() {
    let model = drive(&[effect("lugre_friction", 0, &[0.4, 0.6, 0.1, 20.0, 0.3])]);
    for (z, v) in [(0.0, 0.5), (0.01, 0.05), (-0.02, 0.1), (0.02, -2.0)] {
        let level = 0.4 + 0.2 * f64::exp(-(v / 0.1_f64).powi(2));
        let rate = v - v.abs() * 20.0 * z / level;
        let (force, rates) = at(&model, 0.3, v, &[z]);
        assert_near(force, -20.0 * z - 0.3 * rate, 1e-12, "force");
        assert_near(rates[0], rate, 1e-12, "rate");
    }
}

#[test]
fn a_hot_winding_lets_less_current_through() {
    let model = drive(&[effect("winding_heat", 0, &[0.5, 8.0])]);
    for (tau, w) in [(0.0, 0.3), (2.0, 0.0), (-1.5, 0.6)] {
        let inputs = [&[0.2, 0.7, w, tau, 0.0, w, 0.0], model.values().as_slice()].concat();
        let out = model.program.eval(&inputs);
        let left = 1.0 / (1.0 + 0.5 * w);
        assert_near(out[1], tau * left, 1e-12, "acceleration");
        assert_near(out[2], (tau * tau * left - w) / 8.0, 1e-12, "rate");
    }
}

/// The mass is pushed to and fro by more and by less than the friction holds, in steps of a millisecond and, beside it, in
/// steps of a microsecond.
#[test]
fn a_mass_on_bristles_moves_as_in_fine_steps() {
    let (level, stiffness) = (0.4, 30.0);
    let model = drive(&[effect("presliding", 0, &[level, stiffness])]);
    let mut environment = Environment::new(&model, Integrator::RK4, 1e-3);
    let mut state = [0.0, 0.0];
    let (mut q, mut v, mut z) = (0.0, 0.0_f64, 0.0);
    let fine = 1e-6;
    for step in 0..2000_i32 {
        let time = 1e-3 * f64::from(step);
        let tau = (0.2 + 0.3 * time) * (7.0 * time).sin().signum();
        environment.step(&mut state, &[tau], time);
        for _ in 0..1000 {
            z += fine * (v - v.abs() * stiffness * z / level);
            v += fine * (tau - stiffness * z);
            q += fine * v;
        }
        assert!((state[0] - q).abs() < 2e-4, "{time} s: {} {q}", state[0]);
    }
    assert!(q.abs() > 0.02, "{q}");
}

#[test]
fn an_expression_says_how_states_move() {
    let joint = Joint::at(0);
    let expression = |name: &str| {
        let library = Library::built_in();
        let effect = FittedEffect::absent(library.effect(name).unwrap(), joint);
        let names = effect.parameter_names(&[]);
        (
            effect.expression(&names, Quantity::Torque),
            effect.latex(&names, Quantity::Torque),
        )
    };
    let (text, latex) = expression("presliding");
    assert_eq!(
        text,
        "-sigma_01 * z1, dz1/dt = qd1 - abs(qd1) * sigma_01 * z1 / F_c1"
    );
    assert!(latex.contains("\\dot {z_{1}} ="), "{latex}");
    assert!(
        expression("thermal_friction")
            .0
            .ends_with(", dw1/dt = (1 - w1) / T1")
    );
}

/// The file of an effect with this formula and these lines under `[states]`.
fn file(entry: &str, states: &str) -> String {
    format!(
        "[effect]\nname = \"own\"\nabout = \"\"\n{entry}\n\n[states]\n{states}\n\n\
         [parameters]\nk = {{ unit = \"N m/rad\", typical = 1 }}\n"
    )
}

#[test]
fn a_file_with_a_wrong_state_is_refused_with_its_place() {
    let force = "force = \"-k * z\"";
    let state = "z = { rate = \"qd\", unit = \"rad\" }";
    let read = |text: &str| Effect::from_text(Path::new("own.toml"), text);
    assert!(read(&file(force, state)).is_ok());
    for (entry, states, place, message) in [
        (
            "force = \"-k * y\"",
            state,
            "own.toml, line 4,",
            "unknown name `y`",
        ),
        (
            force,
            "z = { rate = \"qd - v\", unit = \"rad\" }",
            "own.toml, line 7,",
            "unknown name `v`",
        ),
        (force, "z = { rate = \"qd\" }", "own.toml, line 7,", "unit"),
        (force, "z = { unit = \"rad\" }", "own.toml, line 7,", "rate"),
        (
            force,
            "z = { rate = \"qd\", unit = \"rad\", start = \"q\" }",
            "own.toml, line 7,",
            "unknown name `q`",
        ),
        (
            force,
            "z = { rate = \"qd\", unit = \"rad\", within = [\"0\"] }",
            "own.toml, line 7,",
            "`within` must be a list of 2",
        ),
        (
            force,
            "z = { rate = \"qd\", unit = \"rad\" }\nk = { rate = \"z\", unit = \"1\" }",
            "own.toml, line 8,",
            "cannot have the name `k`",
        ),
        (
            force,
            "z = { rate = \"qd\", unit = \"rad\" }\nqd = { rate = \"z\", unit = \"1\" }",
            "own.toml, line 8,",
            "cannot have the name `qd`",
        ),
        (
            "inertia = \"k\"",
            state,
            "own.toml, line 7,",
            "only an effect with force, torque, friction or reading has states",
        ),
    ] {
        let error = read(&file(entry, states)).unwrap_err().to_string();
        assert!(error.starts_with(place), "{error}");
        assert!(error.contains(message), "{error}");
    }
}

/// A pendulum whose friction gives before it slips, as a model file.
const MODEL: &str = "[system]\nname = \"rig\"\njoints = 1\n\n[parameters]\nc = { value = 20.0 }\nb = { value = 6.7 }\n\n\
    [dynamics]\nqdd1 = \"b * tau1 - c * sin(q1)\"\n\n\
    [[effect]]\nname = \"presliding\"\njoint = 1\nF_c = 0.12\nsigma_0 = 5.0\n";

const RECIPE: &str = "model = \"rig.toml\"\nkind = \"physics\"\n[data]\nplant = \"rig.toml\"\ntrajectories = 4\nstep_s = 0.01\n\
    position = [[-1, 1]]\nvelocity = [[-1, 1]]\ntorque = [[-1, 1]]\n";

#[test]
fn what_cannot_carry_states_says_so() {
    let scratch = Scratch::new();
    scratch.file("rig.toml", MODEL);
    scratch.file("recipe.toml", RECIPE);
    let refusal = scratch.refuses("train --config recipe.toml --out run");
    let wanted = "presliding on joint 1 of rig has states of its own, which a model trained on a simulated plant cannot have yet";
    assert!(refusal.contains(wanted), "{refusal}");
}

mod slow {
    use super::*;

    #[test]
    fn closing_the_loop_names_the_effect_with_states() {
        for (effects, named) in [
            (
                "presliding=0.12 presliding.sigma_0=5",
                vec![("presliding", vec![0.12, 5.0])],
            ),
            (
                "coulomb_friction=0.15 thermal_friction=0.5 thermal_friction.T=4",
                vec![
                    ("coulomb_friction", vec![0.15]),
                    ("thermal_friction", vec![0.5, 4.0]),
                ],
            ),
        ] {
            let scratch = Scratch::new();
            let plant = format!("pendulum --duration 15 --effect {effects}");
            scratch.simulates(&plant, &[1, 2, 3, 91]);
            let logs = "--train run1.csv run2.csv run3.csv --test run91.csv";
            let report = scratch.json(&format!("closeloop --model pendulum {logs} --out report"));
            assert_eq!(report["verdict"], "explained", "{effects}");
            let wanted: Vec<&str> = named.iter().map(|(name, _)| *name).collect();
            assert_eq!(names(&report), wanted);
            for (k, (name, truths)) in named.iter().enumerate() {
                for (parameter, truth) in truths.iter().enumerate() {
                    let parameter = &report["effects"][k]["parameters"][parameter];
                    let [_, low, high] = estimate(parameter).unwrap();
                    assert!(low < *truth && *truth < high, "{name}: {parameter}");
                }
            }
            // The written model predicts the same when it is read again.
            let read = scratch.evaluated("--model report/model.toml --test run91.csv");
            assert_near(read / error(&report, "after"), 1.0, 1e-9, effects);
        }
    }
}
