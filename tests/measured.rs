//! Closing the loop on logs measured on real rigs. Where the data are is said in README.

use serde_json::Value;

use crate::support::{measured, succeeds, text};

/// Close the loop with these arguments and return its report.
fn report(arguments: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let all = [&["closeloop", "--json", "--out", text(&out)], arguments].concat();
    serde_json::from_str(&succeeds(&all)).expect("the report is JSON")
}

/// Position error at 0.5 s, after as a share of before.
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
    // Without torque only ratios to the inertia can be known.
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
}
