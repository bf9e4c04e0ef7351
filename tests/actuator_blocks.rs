//! Actuators of position-controlled joints as settings of Isaac Lab and mjlab.

use std::path::Path;

use residyn_core::model::{Library, Model};
use residyn_core::sim::Integrator;
use residyn_formats::{ExportModel, Format, find};
use serde_json::json;

use crate::support::tables::effects;
use crate::support::{Scratch, says};

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

/// What a fit knows of it: effect, joint, values with their intervals.
const FITTED: &str = "
viscous_friction    | 1 | b = { value = 0.3, ci95 = [0.2, 0.45] }
actuator_saturation | 1 | m = { value = 7.0, ci95 = [6.5, 7.5] }
coulomb_friction    | 2 | F_c = { value = 0.6, ci95 = [0.5, 0.8] }
viscous_friction    | 2 | b = { value = 0.3, ci95 = [0.2, 0.45] }
actuator_delay      | 2 | d = { value = 0.0137, ci95 = [0.009, 0.0161] }
actuator_gain       | 2 | g = { value = -0.2, ci95 = [-0.25, -0.1] }
rotor_inertia       | 3 | J = { value = 0.01, ci95 = [-0.001, 0.012] }
constant_torque     | 3 | tau_0 = { value = 0.4, ci95 = [0.3, 0.5] }
";

/// The servo arm with these effects, in steps of 5 ms.
fn arm(beyond: &str) -> ExportModel {
    with_stiffness("value = 40.0", beyond)
}

/// The same with another declaration of the stiffness.
fn with_stiffness(declared: &str, beyond: &str) -> ExportModel {
    let text = include_str!("fixtures/servo_arm.toml").replace("value = 40.0", declared);
    let text = text + &effects(beyond);
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

#[test]
fn intervals_that_no_event_draws_are_listed() {
    let [isaaclab, mjlab] = formats().map(|format| (format.not_carried)(&arm(FITTED)).join("\n"));
    let only_there = [
        "the interval of the limit of the torque, 6.5 to 7.5, on joint 1 (yaw)",
        "the interval of viscous friction, 0.2 to 0.45, on joint 2 (shoulder)",
    ];
    says(&isaaclab, &only_there);
    assert!(!mjlab.contains("interval"), "{mjlab}");
    assert!(
        !isaaclab.contains("viscous friction, 0.2 to 0.45, on joint 1"),
        "{isaaclab}"
    );
}

#[test]
fn richer_friction_is_written_as_its_dry_and_viscous_part() {
    let model = arm("
stribeck_friction   | 1 | F_c = 0.3\\nF_s = 0.5\\nv_s = 0.2
asymmetric_friction | 2 | F_p = 0.5\\nF_n = 0.7\\nb_p = 0.1\\nb_n = 0.3
");
    for format in formats() {
        let not_carried = (format.not_carried)(&model).join("\n");
        let lost = [
            "stribeck_friction on joint 1 (yaw): its excess near standstill; dry friction of 0.3000 is written",
            "asymmetric_friction on joint 2 (shoulder): slopes that differ by direction; their mean is written",
            "a constant torque of 0.1 on joint 2 (shoulder)",
        ];
        says(&not_carried, &lost);
        let [dry, viscous] = match format.name {
            "isaaclab" => ["friction", "viscous_friction"],
            _ => ["frictionloss", "viscous_damping"],
        };
        let written = text(format, &model);
        says(
            &written,
            &[
                &format!(" {dry}=0.3,"),
                &format!(" {dry}=0.6,"),
                &format!(" {viscous}=0.2,"),
            ],
        );
    }
}

#[test]
fn no_factor_makes_friction_of_none() {
    let model = arm("coulomb_friction | 1 | F_c = { value = 0.0, ci95 = [0.0, 0.1] }");
    let [isaaclab, mjlab] = formats();
    assert!(!text(isaaclab, &model).contains("EVENTS ="));
    let lost = (isaaclab.not_carried)(&model).join("\n");
    says(
        &lost,
        &["the interval of dry friction, 0.0 to 0.1, on joint 1 (yaw)"],
    );
    says(
        &text(mjlab, &model),
        &["dr.joint_friction, \"abs\", \"yaw\", ranges=(0.0, 0.1)"],
    );
}

#[test]
fn values_without_intervals_have_no_events() {
    for format in formats() {
        assert!(!text(format, &arm(EFFECTS)).contains("EVENTS"));
    }
}

#[test]
fn ranges_of_a_report_replace_intervals() {
    let model = |range| arm(FITTED).with_intervals(&[("F_c2", range)]);
    for format in formats() {
        let drawn = match format.name {
            "isaaclab" => "(0.5, 1.5)",
            _ => "(0.3, 0.9)",
        };
        let written = text(format, &model([0.3, 0.9]).unwrap());
        let line = written
            .lines()
            .find(|line| line.contains("friction of shoulder"));
        says(line.unwrap(), &[drawn]);
    }
    let refused = |model: Result<ExportModel, String>| model.map(|_| ()).unwrap_err();
    says(
        &refused(model([0.7, 0.9])),
        &["`F_c2` is 0.6 in the model, not within 0.7 to 0.9"],
    );
    let unknown = arm(FITTED).with_intervals(&[("F_c9", [0.0, 1.0])]);
    says(&refused(unknown), &["the model has no parameter `F_c9`"]);
}

#[test]
fn the_command_takes_the_ranges_of_a_report() {
    let scratch = Scratch::new();
    let arm = include_str!("fixtures/servo_arm.toml").to_owned() + &effects(FITTED);
    scratch.file("arm.toml", arm);
    let range = |name: &str, range: serde_json::Value| json!({"name": name, "unit": "N m", "value": 0.6, "range": range});
    let closed_and_open = json!([
        range("F_c2", json!([0.3, 0.9])),
        range("b1", json!([null, 1.0]))
    ]);
    scratch.file("ranges.json", closed_and_open.to_string());
    let export = |ranges: &str| {
        format!("export --model arm.toml --ranges {ranges} --format mjlab --out blocks.py")
    };
    let said = scratch.succeeds(&export("ranges.json"));
    says(&said, &["blocks.py: ACTUATORS, one a joint, and EVENTS"]);
    assert!(
        !said.contains("difference"),
        "settings predict nothing: {said}"
    );
    says(
        &scratch.read("blocks.py"),
        &["ranges=(0.3, 0.9)", "ranges=(0.2, 0.45)"],
    );
    scratch.file(
        "other.json",
        json!([range("F_c9", json!([0.0, 1.0]))]).to_string(),
    );
    scratch.file("broken.json", "{");
    for (ranges, words) in [
        (
            "other.json",
            "other.json: of another model: the model has no parameter `F_c9`",
        ),
        ("broken.json", "broken.json"),
        ("absent.json", "absent.json"),
    ] {
        says(&scratch.refuses(&export(ranges)), &[words]);
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
        for (format, actuators) in formats().into_iter().zip([isaaclab, mjlab]) {
            agrees(
                format,
                &arm(EFFECTS),
                &json!({"actuators": actuators, "events": {}}),
            );
        }
    }

    #[test]
    fn events_draw_from_the_intervals_of_the_fit() {
        let delays = [
            ["min_delay", "max_delay"],
            ["delay_min_lag", "delay_max_lag"],
        ];
        let isaaclab = json!({
            "friction of yaw": ["randomize_joint_parameters", "scale", {"friction_distribution_params": [0.2 / 0.3, 1.5]}],
            "gains of shoulder": ["randomize_actuator_gains", "abs", {
                "stiffness_distribution_params": [30.0, 36.0], "damping_distribution_params": [0.9, 1.08]}],
            "friction of shoulder":
                ["randomize_joint_parameters", "scale", {"friction_distribution_params": [0.5 / 0.6, 0.8 / 0.6]}],
            "armature of elbow": ["randomize_joint_parameters", "abs", {"armature_distribution_params": [0.0, 0.012]}],
        });
        let mjlab = json!({
            "limit of yaw": ["effort_limits", "abs", {"effort_limit_range": [6.5, 7.5]}],
            "viscous friction of yaw": ["joint_damping", "abs", {"ranges": [0.2, 0.45]}],
            "gains of shoulder": ["pd_gains", "abs", {"kp_range": [30.0, 36.0], "kd_range": [0.9, 1.08]}],
            "limit of shoulder": ["effort_limits", "abs", {"effort_limit_range": [6.75, 8.1]}],
            "dry friction of shoulder": ["joint_friction", "abs", {"ranges": [0.5, 0.8]}],
            "viscous friction of shoulder": ["joint_damping", "abs", {"ranges": [0.2, 0.45]}],
            "armature of elbow": ["joint_armature", "abs", {"ranges": [0.0, 0.012]}],
        });
        let expected = formats().into_iter().zip(delays).zip([isaaclab, mjlab]);
        for ((format, [shortest, longest]), events) in expected {
            let late = json!([{}, {shortest: 2, longest: 3}, {}]);
            agrees(
                format,
                &arm(FITTED),
                &json!({"actuators": late, "events": events}),
            );
        }
    }

    #[test]
    fn intervals_of_a_drive_and_of_its_gain_add_up_as_squares() {
        let gain = "actuator_gain | 2 | g = { value = -0.2, ci95 = [-0.25, -0.1] }";
        let model = with_stiffness("value = 40.0, ci95 = [37.0, 43.0]", gain);
        let [down, up] = [[2.4, 2.0], [2.4, 4.0]].map(|[by_kp, by_g]: [f64; 2]| by_kp.hypot(by_g));
        let of_joint = |stiffness: [f64; 2], damping: [f64; 2]| json!(["pd_gains", "abs", {"kp_range": stiffness, "kd_range": damping}]);
        let alone = of_joint([37.0, 43.0], [1.2, 1.2]);
        let events = json!({
            "gains of yaw": alone,
            "gains of shoulder": of_joint([32.0 - down, 32.0 + up], [0.9, 1.08]),
            "limit of shoulder": ["effort_limits", "abs", {"effort_limit_range": [6.75, 8.1]}],
            "gains of elbow": alone,
        });
        let [_, mjlab] = formats();
        agrees(
            mjlab,
            &model,
            &json!({"actuators": [{}, {}, {}], "events": events}),
        );
    }

    /// Requires these fields of the blocks, and these events, in the file of a model.
    fn agrees(format: &Format, model: &ExportModel, expected: &serde_json::Value) {
        let folder = tempfile::tempdir().unwrap();
        let [blocks, file] = ["blocks.py", "expected.json"].map(|name| folder.path().join(name));
        format.write(model, &blocks).unwrap();
        std::fs::write(&file, expected.to_string()).unwrap();
        client("actuator_blocks.py", &[&blocks, &file]);
    }
}
