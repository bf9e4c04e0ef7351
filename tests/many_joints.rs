//! The report of a rig of many joints: one table of joints by effects, like joints side by side, what differs first, and the
//! details of each joint behind it.

use std::fs;

use serde_json::{Value, json};

use crate::support::demo::demo;
use crate::support::{Scratch, says};

const LEGS: [&str; 4] = ["FL", "FR", "RL", "RR"];
const ROLES: [&str; 3] = ["hip", "thigh", "calf"];
const JOINTS: usize = 12;

/// The names of the joints, leg by leg.
fn names() -> Vec<String> {
    let joints = |leg| ROLES.map(|role| format!("{leg}_{role}_joint"));
    LEGS.into_iter().flat_map(joints).collect()
}

/// A value with its interval.
fn parameter(name: &str, joint: usize, value: f64, unit: &str) -> Value {
    json!({
        "name": format!("{name}{joint}"), "value": value, "ci95": [0.95 * value, 1.05 * value], "unit": unit,
        "identifiable": true, "at_bound": false
    })
}

/// A made-up report of a quadruped, in the shape of the demo's: dry friction on all joints, delays on the hips that are not
/// certain, refitted gains, and one worn calf.
fn quadruped() -> Value {
    let mut report: Value =
        serde_json::from_str(&fs::read_to_string(demo().join("report.json")).unwrap()).unwrap();
    let names = names();
    let card = report["effects"][0].clone();
    let effect = |name: &str, joint: usize, parameter: Value| {
        let mut effect = card.clone();
        effect["name"] = json!(name);
        effect["title"] = json!(name);
        effect["joint"] = json!(joint);
        effect["place"] = json!(format!("{joint} ({})", names[joint - 1]));
        effect["parameters"] = json!([parameter]);
        effect
    };
    let friction = |joint: usize| {
        let level = if joint == 9 { 0.54 } else { 0.3 };
        effect(
            "coulomb_friction",
            joint,
            parameter("F_c", joint, level, "N m"),
        )
    };
    let delay = |joint: usize| effect("actuator_delay", joint, parameter("d", joint, 0.01, "s"));
    let gain = |joint: usize| json!({"joint": joint, "of": "kp", "parameters": [parameter("kp_", joint, 20.0, "N m/rad")]});
    let rival = |joint: usize| {
        json!({
            "effects": [], "title": "stribeck_friction", "place": format!("{joint} ({})", names[joint - 1]),
            "reason": format!("contains what was found on joint {joint}"), "experiment": "move slowly", "separation": null
        })
    };
    let all = || 1..=JOINTS;
    report["system"] = json!("quadruped");
    report["joints"] = json!(JOINTS);
    report["joint_names"] = json!(names);
    report["prismatic"] = json!(vec![false; JOINTS]);
    report["headline"] = json!("The model lacks coulomb_friction on 12 joints");
    report["reason"] = json!("the effects found leave no significant residual; one more remark");
    report["like_joints"] = json!([[1, 4, 7, 10], [2, 5, 8, 11], [3, 6, 9, 12]]);
    report["differences"] = json!([{
        "of": "coulomb_friction", "parameter": "F_c", "unit": "N m", "joints": [9], "value": 0.54, "others": [3, 6, 12],
        "of_others": 0.3
    }]);
    report["effects"] = all().map(friction).collect();
    report["supported"] = [1, 4, 7, 10].into_iter().map(delay).collect();
    report["of_joints"] = all().map(gain).collect();
    report["alternatives"] = all().map(rival).collect();
    report["torque"] = Value::Null;
    report["calibration"] = Value::Null;
    report["error"]["by_log"] = json!([]);
    for model in [
        "declared",
        "before",
        "with_friction",
        "after",
        "zeroed",
        "hybrid",
    ] {
        widen(&mut report["error"][model]);
    }
    for other in report["error"]["against"].as_array_mut().unwrap() {
        widen(other);
    }
    for segment in report["plots"]["segments"].as_array_mut().unwrap() {
        segment["joints"] = vec![segment["joints"][0].clone(); JOINTS].into();
    }
    let cloud = report["plots"]["residuals"][0].clone();
    let cloud = |joint: usize| {
        let mut cloud = cloud.clone();
        cloud["joint"] = json!(joint);
        cloud
    };
    report["plots"]["residuals"] = all().map(cloud).collect();
    report
}

/// Errors of one joint become those of all.
fn widen(model: &mut Value) {
    if model.is_null() {
        return;
    }
    for kind in ["position_rmse", "position_median", "velocity_rmse"] {
        if let Some(horizons) = model[kind].as_array_mut() {
            for horizon in horizons {
                *horizon = vec![horizon[0].clone(); JOINTS].into();
            }
        }
    }
}

/// A folder in which the pages were made from the quadruped's report.
fn made() -> Scratch {
    let scratch = Scratch::new();
    scratch.file("report.json", quadruped().to_string());
    scratch.succeeds("report .");
    scratch
}

const WORN: &str =
    "RL_calf: coulomb_friction F_c 0.540 N m, 1.8 times that of FL_calf, FR_calf and RR_calf";

#[test]
fn the_text_has_one_table_of_joints_by_effects() {
    let text = made().read("report.md");
    let at = |what: &str| {
        text.find(what)
            .unwrap_or_else(|| panic!("{what} is missing"))
    };
    let table = "| joint | error 0.5 s ahead, fitted, mrad | with effects | coulomb_friction `F_c`, N m | kp, N m/rad | \
                 actuator_delay `d`, s |";
    assert!(at("The model lacks") < at(WORN) && at(WORN) < at(table));
    let rows: Vec<&str> = text[at(table)..].lines().skip(2).take(JOINTS).collect();
    let named = |row: &&str| row.split('|').nth(1).unwrap().trim().to_owned();
    let order = [
        "1 FL_hip",
        "4 FR_hip",
        "7 RL_hip",
        "10 RR_hip",
        "2 FL_thigh",
    ];
    assert_eq!(rows.iter().map(named).take(5).collect::<Vec<_>>(), order);
    assert!(
        rows[0].ends_with("| **0.300** | 20.0 | 0.01000 |"),
        "{}",
        rows[0]
    );
    assert!(
        rows[10].ends_with("| **0.540** \u{25b2} | 20.0 |  |"),
        "{}",
        rows[10]
    );
    // What there was for each effect is with its joint.
    let calf = &text[at("### Joint 9 (RL_calf_joint)")..at("### Joint 12 (RR_calf_joint)")];
    says(
        calf,
        &[
            WORN,
            "`F_c9` = 0.540 N m (0.513 to 0.567)",
            "`kp_9` = 20.0 N m/rad",
            "contains what was found on joint 9",
            "| 0.5 s | 9 (RL_calf_joint) |",
        ],
    );
    assert!(!calf.contains("on joint 12"), "{calf}");
}

#[test]
fn the_page_has_a_part_for_each_joint_that_the_table_points_to() {
    let page = made().read("report.html");
    for joint in 1..=JOINTS {
        assert_eq!(page.matches(&format!("href=\"#joint-{joint}\"")).count(), 1);
        assert_eq!(page.matches(&format!("id=\"joint-{joint}\"")).count(), 1);
    }
    assert_eq!(page.matches("class=\"established differs\"").count(), 1);
    assert_eq!(page.matches("class=\"supported\"").count(), 4);
    let drawn = page.matches("data-over=\"qd\"").count();
    assert_eq!(drawn, JOINTS, "each residual force is drawn once");
}

#[test]
fn the_answer_fits_thirty_lines_of_a_hundred_characters() {
    let said = |report: Value| {
        let report: residyn_report::Report = serde_json::from_value(report).unwrap();
        let words = residyn_report::Words::default();
        let said = residyn_report::summary(&report, &[], "report".as_ref(), &[], &words);
        assert!(said.lines().count() <= 30, "{said}");
        assert!(
            said.lines().all(|line| line.chars().count() <= 100),
            "{said}"
        );
        said
    };
    let mut report = quadruped();
    let usual = said(report.clone());
    says(
        &usual,
        &[
            "The model lacks coulomb_friction on 12 joints: the effects found leave no significant residual",
            "1 more remark in report.md",
            "mrad with effects",
            "9 RL_calf ",
            "0.54>",
            "(0.010)",
            &format!("differs: {WORN}"),
            "not ruled out: 12, in report.md",
            "What is left? ",
            "report.html",
        ],
    );
    // Of more rows than fit, that of the joint that differs is there.
    let names: Vec<String> = (1..=30).map(|k| format!("leg_{k}_of_many_joint")).collect();
    report["joints"] = json!(30);
    report["joint_names"] = json!(names);
    report["differences"][0]["joints"] = json!([9]);
    for model in ["declared", "before", "after"] {
        for kind in ["position_rmse", "position_median", "velocity_rmse"] {
            for horizon in report["error"][model][kind].as_array_mut().unwrap() {
                *horizon = vec![horizon[0].clone(); 30].into();
            }
        }
    }
    let many = said(report);
    says(
        &many,
        &["9 leg_9_of_many", "and 18 more joints in report.md"],
    );
}

#[test]
fn a_difference_of_unknown_joints_is_refused() {
    let scratch = Scratch::new();
    let mut report = quadruped();
    report["differences"][0]["others"] = json!([13]);
    scratch.file("report.json", report.to_string());
    let said = scratch.refuses("report .");
    assert!(said.contains("it has no joint 13"), "{said}");
}

/// Two pendulums that do not move each other.
const PAIR: &str = "[system]\nname = \"pair\"\njoints = 2\njoint_names = [\"left_swing\", \"right_swing\"]\n\n\
    [parameters]\nC_g = { value = -17.4, unit = \"1/s^2\" }\nC_i = { value = 4.6, unit = \"1/(kg m^2)\", positive = true }\n\n\
    [dynamics]\nqdd1 = \"C_g * sin(q1) + C_i * tau1\"\nqdd2 = \"C_g * sin(q2) + C_i * tau2\"\n";

/// The right one is worn.
const RIG: &str = "model = \"pair.toml\"\nsensor = { rate_hz = 100, position_noise = 1e-3, position_step = 0 }\n\
    excitation = { amplitude = [1.6, 1.6], band_hz = [0.15, 2.0], tones = 8 }\n\
    recording = { logs = 1, duration_s = 15, start = [0, 0, 0, 0] }\n\n\
    [[effect]]\nname = \"coulomb_friction\"\njoint = 1\nF_c = 0.1\n\n\
    [[effect]]\nname = \"coulomb_friction\"\njoint = 2\nF_c = 0.25\n";

#[test]
fn a_worn_joint_is_told_from_its_like() {
    let scratch = Scratch::new();
    scratch.file("pair.toml", PAIR);
    scratch.file("rig.toml", RIG);
    scratch.simulates("rig.toml", &[1, 2]);
    let report =
        scratch.json("closeloop --model pair.toml --train run1.csv --test run2.csv --out report");
    assert_eq!(report["like_joints"], json!([[1, 2]]));
    let found = &report["differences"][0];
    assert_eq!(found["of"], "coulomb_friction");
    assert_eq!(found["parameter"], "F_c");
    assert_eq!(
        [&found["joints"], &found["others"]],
        [&json!([2]), &json!([1])]
    );
    let [worn, usual] = ["value", "of_others"].map(|key| found[key].as_f64().unwrap());
    assert!(
        (worn - 0.25).abs() < 0.03 && (usual - 0.1).abs() < 0.03,
        "{found}"
    );
}

mod slow {
    use crate::support::clients::look_at;

    #[test]
    fn a_browser_shows_the_page_of_many_joints() {
        look_at(&super::made().path("report.html"));
    }
}
