//! Parameters that a file declares fixed although the rig has other values.

use std::path::Path;

use residyn::read_model;
use residyn_core::expr::SignForm;
use residyn_core::model::{Library, Model};

use crate::support::Scratch;
use crate::support::catalogue::{assert_near, dynamics, points};
use crate::support::reports::{error, estimate, names};

/// An arm in masses. The motor's inertia is known, so that a heavier arm is not a weaker motor.
const ARM: &str = r#"
[system]
name = "arm"
joints = 1

[parameters]
m = { value = 1.0, unit = "kg", positive = true, fixed = true }
l = { value = 0.5, unit = "m", positive = true, fixed = true }
J = { value = 0.08, unit = "kg m^2", positive = true, fixed = true }
b = { value = 0.05, unit = "N m s/rad", positive = true }
g = { value = 9.81, unit = "m/s^2", fixed = true }

[dynamics]
mass = [["m*l^2 + J"]]
bias = ["m*g*l*sin(q1) + b*qd1"]
"#;

const TRUE_M: f64 = 1.2;

/// The arm as built.
const RIG: &str = "model = \"arm.toml\"\nparameters = { m = 1.2 }\n\
    sensor = { rate_hz = 100, position_noise = 1e-3, position_step = 0 }\n\
    excitation = { amplitude = [4.0], band_hz = [0.15, 2.0], tones = 8 }\n\
    recording = { logs = 1, duration_s = 12, start = [0, 0] }\n";

fn read(text: &str) -> Model {
    Model::from_text(Path::new("model.toml"), text, Library::built_in().effects()).unwrap()
}

#[test]
fn fixed_parameters_but_gravity_can_be_shifted() {
    let acrobot = Library::system_text("acrobot").unwrap();
    let fixed = acrobot.replace("positive = true", "positive = true, fixed = true");
    let found: Vec<(String, usize)> = read(&fixed)
        .shifts()
        .iter()
        .map(|shift| (shift.effect.parameters[0].name.clone(), shift.joint.index()))
        .collect();
    // The first link moves with the first joint only; all other bodies turn with the second.
    let wanted = [
        ("m1", 0),
        ("m2", 1),
        ("l1", 1),
        ("lc1", 0),
        ("lc2", 1),
        ("I1", 0),
        ("I2", 1),
    ];
    assert_eq!(found, wanted.map(|(name, joint)| (name.to_owned(), joint)));
    assert_eq!(read(acrobot).shifts(), []);
}

#[test]
fn a_shift_equals_a_file_with_the_shifted_value() {
    let arm = read(ARM);
    let heavier = dynamics(
        &read(&ARM.replace("value = 1.0", "value = 1.25")),
        &[],
        SignForm::Exact,
    );
    let mut shift = arm.shifts().remove(0);
    // A positive parameter stays positive.
    assert!(shift.effect.parameters[0].bounds[0] > -1.0);
    assert!(shift.effect.parameters[0].bounds[0] < -0.99);
    shift.values[0].0 = 0.25;
    let shifted = dynamics(&arm, &[shift.clone()], SignForm::Exact);
    assert_eq!(shifted.parameters[5].name, "m_shift");
    for mut point in points(&heavier, 50, 4) {
        let wanted = heavier.program.eval(&point)[1];
        point[4] -= 0.25;
        point.push(0.25);
        assert_near(shifted.program.eval(&point)[1], wanted, 1e-12, "arm");
    }
    // Two parameters of one joint may be shifted, but not one of them twice.
    let other = arm.shifts().remove(1);
    assert!(arm.check_effect(&other, &[shift.clone()]).is_ok());
    assert!(arm.check_effect(&shift, &[other, shift.clone()]).is_err());
}

mod slow {
    use super::*;

    #[test]
    fn a_wrong_mass_is_named_with_its_right_value() {
        let scratch = Scratch::new();
        scratch.file("arm.toml", ARM);
        scratch.file("rig.toml", RIG);
        scratch.simulates("rig.toml", &[1, 2, 3, 4]);
        let logs = "--train run1.csv run2.csv run3.csv --test run4.csv";
        let report = scratch.json(&format!("closeloop --model arm.toml {logs} --out report"));
        assert_eq!(report["verdict"], "explained");
        assert_eq!(names(&report), ["parameter_shift"]);
        let effect = &report["effects"][0];
        assert_eq!(effect["expression"], "m = 1.2 (declared 1)");
        let parameter = &effect["parameters"][0];
        assert_eq!(parameter["name"], "m");
        assert_eq!(parameter["unit"], "kg");
        let [value, low, high] = estimate(parameter).unwrap();
        assert!((value - TRUE_M).abs() < high - low, "{parameter}");
        assert!(high - low < 0.01, "{parameter}");
        // The written model holds the shifted value in the parameter's place, and predicts the same, as does the
        // checkpoint's.
        let library = Library::built_in();
        let written = read_model(scratch.path("report/model.toml"), &library).unwrap();
        assert!(written.effects.is_empty());
        assert_eq!(written.parameters[0].value, value);
        for (model, of, share) in [
            ("--model report/model.toml", "after", 1e-9),
            ("--checkpoint report/checkpoint", "hybrid", 1e-6),
        ] {
            let read = scratch.evaluated(&format!("{model} --test run4.csv"));
            assert_near(read, error(&report, of), share, model);
        }
    }
}
