//! Actuators of position-controlled joints as settings of Isaac Lab and mjlab.

use std::path::Path;

use residyn_core::model::{Library, Model};
use residyn_core::sim::Integrator;
use residyn_formats::{ExportModel, Format, find};
use serde_json::json;

use crate::support::says;
use crate::support::tables::effects;

/// What the joints of the servo arm have beyond its description: effect, joint, values.
const EFFECTS: &str = "
viscous_friction    | 1 | b = 0.3
actuator_saturation | 1 | m = 7.0
coulomb_friction    | 2 | F_c = 0.6
actuator_delay      | 2 | d = 0.0137
actuator_gain       | 2 | g = -0.2
rotor_inertia       | 3 | J = 0.01
constant_torque     | 3 | tau_0 = 0.4
load_friction       | 3 | k = 0.1
sensor_offset       | 3 | q_z = 0.02
";

/// The servo arm with these effects, in steps of 5 ms.
fn arm(beyond: &str) -> ExportModel {
    let text = include_str!("fixtures/servo_arm.toml").to_owned() + &effects(beyond);
    let model = Model::from_text(Path::new("arm"), &text, Library::built_in().effects()).unwrap();
    ExportModel::of_system(&model, Integrator::RK4, 0.005, json!({}))
}

/// The formats of actuator blocks.
fn formats() -> [&'static Format; 2] {
    ["isaaclab", "mjlab"].map(|name| find(name).unwrap())
}

fn text(format: &Format, model: &ExportModel) -> String {
    let mut files = (format.files)(model, Path::new("blocks.py")).unwrap();
    String::from_utf8(files.remove(0).bytes).unwrap()
}

#[test]
fn what_blocks_do_not_hold_is_listed_by_joint_in_their_head() {
    for format in formats() {
        let model = arm(EFFECTS);
        let head = text(format, &model);
        let (head, _) = head.split_once("import").unwrap();
        for what in (format.not_carried)(&model) {
            says(head, &[&format!("# not carried: {what}")]);
        }
        for what in [
            "load_friction on joint 3 (elbow): -k3 * abs(load3) * sign(qd3)",
            "a constant torque of 0.4 on joint 3 (elbow)",
            "a zero that is off by 0.02 on joint 3 (elbow)",
            "the bodies",
        ] {
            says(head, &[&format!("# not carried: {what}")]);
        }
        assert_eq!(head.matches("not carried").count(), 5, "{head}");
    }
}

#[test]
fn a_drive_that_holds_no_position_has_no_block() {
    let pendulum = Library::built_in().model("pendulum").unwrap();
    let model = ExportModel::of_system(&pendulum, Integrator::RK4, 0.01, json!({}));
    for format in formats() {
        let error = (format.files)(&model, Path::new("blocks.py")).unwrap_err();
        says(
            &error.to_string(),
            &["joint 1 is not held at a position", "kp*(cmd - q) - kd*qd"],
        );
    }
}

#[test]
fn a_name_is_a_pattern_that_no_other_name_matches() {
    let description = include_str!("fixtures/servo_arm.toml").replace("\"elbow\"", "\"arm.elbow\"");
    let library = Library::built_in();
    let model = Model::from_text(Path::new("arm"), &description, library.effects()).unwrap();
    let model = ExportModel::of_system(&model, Integrator::RK4, 0.005, json!({}));
    for format in formats() {
        says(&text(format, &model), &[r#""arm\\.elbow""#]);
    }
}

mod slow {
    use super::*;
    use crate::support::clients::client;

    #[test]
    fn blocks_run_on_stand_ins_of_their_classes() {
        let isaaclab = json!([
            {"class": "ImplicitActuatorCfg", "stiffness": 40.0, "damping": 1.2, "effort_limit_sim": 7.0,
             "viscous_friction": 0.3, "armature": 0.0},
            {"class": "DelayedPDActuatorCfg", "stiffness": 32.0, "damping": 0.96, "effort_limit": 7.2,
             "friction": 0.6, "dynamic_friction": 0.6, "min_delay": 3, "max_delay": 3},
            {"class": "ImplicitActuatorCfg", "stiffness": 40.0, "effort_limit_sim": 9.0, "armature": 0.01},
        ]);
        let mjlab = json!([
            {"target_names_expr": ["yaw"], "stiffness": 40.0, "damping": 1.2, "effort_limit": 7.0,
             "viscous_damping": 0.3, "delay_max_lag": 0},
            {"target_names_expr": ["shoulder"], "stiffness": 32.0, "damping": 0.96, "effort_limit": 7.2,
             "frictionloss": 0.6, "delay_min_lag": 3, "delay_max_lag": 3},
            {"target_names_expr": ["elbow"], "stiffness": 40.0, "effort_limit": 9.0, "armature": 0.01},
        ]);
        for (format, expected) in formats().into_iter().zip([isaaclab, mjlab]) {
            let folder = tempfile::tempdir().unwrap();
            let [blocks, file] =
                ["blocks.py", "expected.json"].map(|name| folder.path().join(name));
            format.write(&arm(EFFECTS), &blocks).unwrap();
            std::fs::write(&file, expected.to_string()).unwrap();
            client("actuator_blocks.py", &[&blocks, &file]);
        }
    }
}
