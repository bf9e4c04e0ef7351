//! Closing the loop on logs measured on real rigs. README says where the data are.

use serde_json::Value;

use crate::support::{answers, measured, succeeds, text};

/// Close the loop with these arguments and return its report.
fn report(arguments: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let all = [&["closeloop", "--json", "--out", text(&out)], arguments].concat();
    serde_json::from_str(&answers(&all)).expect("the report is JSON")
}

/// Position error at 0.5 s, after the loop is closed relative to before.
fn ratio(report: &Value, joint: usize) -> f64 {
    let rmse = |model: &str| {
        report["error"][model]["position_rmse"][1][joint]
            .as_f64()
            .unwrap()
    };
    assert_eq!(report["error"]["horizons_s"][1], 0.5);
    rmse("after") / rmse("before")
}

fn names(report: &Value) -> Vec<String> {
    let effects = report["effects"].as_array().unwrap();
    effects
        .iter()
        .map(|e| e["name"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn dry_friction_is_found_in_a_geared_pendulum() {
    let Some(data) = measured("dfki_simple_pendulum") else {
        return;
    };
    let log = |name: &str| data.join(name).to_str().unwrap().to_owned();
    let (ddp, collocation) = (
        log("ddp_pd_tracking.csv"),
        log("direct_collocation_pd_tracking.csv"),
    );
    let (energy, ilqr) = (log("energy_shaping.csv"), log("ilqr_20210706.csv"));
    let pushed = |t: &str| format!("energy_shaping.csv@{t}");
    let touched = [pushed("7.2-7.6"), pushed("11.5-12.4"), pushed("15.8-16.4")];
    let report = report(&[
        "--model",
        "pendulum",
        "--train",
        &ddp,
        &collocation,
        &energy,
        "--test",
        &ilqr,
        "--leave-out",
        &touched[0],
        &touched[1],
        &touched[2],
    ]);
    let found = names(&report);
    let dry = [
        "coulomb_friction",
        "stribeck_friction",
        "asymmetric_friction",
    ];
    assert!(
        found.iter().any(|name| dry.contains(&name.as_str())),
        "{found:?}"
    );
    assert!(ratio(&report, 0) <= 0.7, "{}", ratio(&report, 0));
    assert_eq!(
        report["logs"]["train"][2]["leave_out"]
            .as_array()
            .unwrap()
            .len(),
        3
    );
}

#[test]
fn friction_is_found_in_a_pendulum_that_swings_freely() {
    let Some(data) = measured("multiarm_single_pendulum") else {
        return;
    };
    let log = data.join("free_swing_identification.csv");
    let report = report(&["--model", "pendulum", "--train", text(&log)]);
    assert!(!names(&report).is_empty());
    assert!(ratio(&report, 0) <= 0.3, "{}", ratio(&report, 0));
    // Without torque, only ratios to the inertia can be determined.
    assert_eq!(report["identifiability"]["held"][0], "C_i");
    assert_eq!(report["logs"]["split"]["end_of_each_log"]["gap_s"], 0.5);
}

#[test]
fn the_loop_closes_on_a_double_pendulum() {
    let Some(data) = measured("dfki_double_pendulum_c1") else {
        return;
    };
    let log = |name: &str| data.join(name).to_str().unwrap().to_owned();
    let (a, b) = (log("sysid_143339.csv"), log("sysid_143601.csv"));
    let report = report(&[
        "--model",
        "acrobot",
        "--train",
        &a,
        &b,
        "--test",
        &log("pendubot_tvlqr_01.csv"),
    ]);
    assert_eq!(report["joints"], 2);
    assert!(!names(&report).is_empty());
    assert!(ratio(&report, 1) < 1.0, "{}", ratio(&report, 1));
    let of_torques = |model: &str| report["torque"][model]["relative"].as_f64().unwrap();
    assert!(
        of_torques("after") < of_torques("before"),
        "{}",
        report["torque"]
    );
    assert_eq!(
        report["torque"]["as_declared"]["rms"]
            .as_array()
            .unwrap()
            .len(),
        2
    );
}

/// Parameters of the lab's own identification from `pd_system_identification.csv`.
const PUBLISHED: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/docs/rigs/dfki_simple_pendulum_published.toml"
);

#[test]
fn a_log_that_misled_an_identification_is_told_from_a_good_one() {
    let Some(data) = measured("dfki_simple_pendulum") else {
        return;
    };
    let findings = |log: &str| {
        let log = data.join(log);
        let json = answers(&["audit", "--json", "--model", "pendulum", text(&log)]);
        let audits: Value = serde_json::from_str(&json).unwrap();
        audits[0]["findings"].as_array().unwrap().clone()
    };
    let says = |findings: &[Value], severity: &str, words: &str| {
        let fits = |f: &&Value| {
            f["severity"] == severity && f["text"].as_str().is_some_and(|text| text.contains(words))
        };
        findings.iter().find(fits).is_some()
    };
    let poor = findings("pd_system_identification.csv");
    for (severity, words) in [
        ("serious", "tau1 chatters: 2.2"),
        ("warning", "disagree with dq1/dt"),
        ("warning", "s of motion, 6 intervals"),
        ("warning", "the motion explains 14."),
        ("warning", "trails tau1 by 15."),
    ] {
        assert!(says(&poor, severity, words), "{words}: {poor:#?}");
    }
    let good = findings("ddp_pd_tracking.csv");
    assert!(good.iter().all(|f| f["severity"] != "serious"), "{good:#?}");
    assert!(!says(&good, "warning", "the motion explains"), "{good:#?}");
}

#[test]
fn published_values_fail_on_other_logs_and_the_report_says_which() {
    let Some(data) = measured("dfki_simple_pendulum") else {
        return;
    };
    let log = |name: &str| data.join(name).to_str().unwrap().to_owned();
    let report = report(&[
        "--model",
        PUBLISHED,
        "--train",
        &log("ddp_pd_tracking.csv"),
        "--test",
        &log("direct_collocation_pd_tracking.csv"),
        "--against",
        PUBLISHED,
    ]);
    let error = &report["error"];
    let rmse = |model: &Value| model["position_rmse"][1][0].as_f64().unwrap();
    assert_eq!(rmse(&error["against"][0]), rmse(&error["declared"]));
    assert!(
        rmse(&error["before"]) < 0.3 * rmse(&error["declared"]),
        "{error}"
    );
    // The documented masses (0.676 kg at 0.45 m) give 0.30 kg m and 0.14 kg m^2 without the rotor.
    let contradicted = report["contradicted"].as_array().unwrap();
    for name in ["J", "mc"] {
        let one = contradicted.iter().find(|one| one["name"] == name);
        let one = one.unwrap_or_else(|| panic!("{name} is not contradicted: {contradicted:#?}"));
        let factor = one["value"].as_f64().unwrap() / one["declared"].as_f64().unwrap();
        assert!((2.0..5.0).contains(&factor), "{name}: {factor}");
    }
}

#[test]
fn published_models_of_a_double_pendulum_are_scored_as_they_are() {
    let Some(data) = measured("dfki_double_pendulum_c1") else {
        return;
    };
    let log = data.join("acrobot_tvlqr_01.csv");
    for number in ["1", "2"] {
        let rigs = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/rigs");
        let model = format!("{rigs}/dfki_double_pendulum_c1_model_{number}.toml");
        let json = succeeds(&[
            "evaluate",
            "--json",
            "--model",
            &model,
            "--test",
            text(&log),
        ]);
        let error: Value = serde_json::from_str(&json).unwrap();
        assert_eq!(error["diverged"], serde_json::json!([0, 0, 0]));
        // A wrong sign of gravity or friction costs many times this over half a second.
        for joint in 0..2 {
            let median = error["position_median"][1][joint].as_f64().unwrap();
            assert!(
                median < 0.1,
                "model {number}, joint {}: {median}",
                joint + 1
            );
        }
    }
}
