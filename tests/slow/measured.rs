//! Closing the loop on logs measured on real rigs. README says where the data are.

use std::fs;

use serde_json::Value;

use crate::support::reports::{error_of_joint, names};
use crate::support::{Scratch, measured};

/// A folder with these logs of a set; `None` if it is not there.
fn with_logs(set: &str, logs: &[&str]) -> Option<Scratch> {
    let (data, scratch) = (measured(set)?, Scratch::new());
    for log in logs {
        fs::copy(data.join(log), scratch.path(log)).unwrap();
    }
    Some(scratch)
}

/// The report of closing the loop with these words.
fn report(scratch: &Scratch, given: &str) -> Value {
    // What is found must not depend on how busy the machine is.
    let line = format!("closeloop --json --budget 1h --out report {given}");
    serde_json::from_str(&scratch.answers(&line)).expect("the report is JSON")
}

/// Position error at 0.5 s, after the loop is closed relative to before.
fn ratio(report: &Value, joint: usize) -> f64 {
    let [before, after] = ["before", "after"].map(|model| error_of_joint(report, model, joint));
    after / before
}

#[test]
fn dry_friction_is_found_in_a_geared_pendulum() {
    let [ddp, collocation, energy, ilqr] = [
        "ddp_pd_tracking.csv",
        "direct_collocation_pd_tracking.csv",
        "energy_shaping.csv",
        "ilqr_20210706.csv",
    ];
    let all = [ddp, collocation, energy, ilqr];
    let Some(scratch) = with_logs("dfki_simple_pendulum", &all) else {
        return;
    };
    let touched = ["7.2-7.6", "11.5-12.4", "15.8-16.4"].map(|span| format!("{energy}@{span}"));
    let logs = format!("--train {ddp} {collocation} {energy} --test {ilqr}");
    let left_out = touched.join(" ");
    let given = format!("--model pendulum {logs} --leave-out {left_out}");
    let report = report(&scratch, &given);
    let found = names(&report);
    let dry = [
        "coulomb_friction",
        "stribeck_friction",
        "asymmetric_friction",
    ];
    assert!(found.iter().any(|name| dry.contains(name)), "{found:?}");
    assert!(ratio(&report, 0) <= 0.7, "{}", ratio(&report, 0));
    let left_out = &report["logs"]["train"][2]["leave_out"];
    assert_eq!(left_out.as_array().unwrap().len(), 3);
}

#[test]
fn friction_is_found_in_a_pendulum_that_swings_freely() {
    let log = "free_swing_identification.csv";
    let Some(scratch) = with_logs("multiarm_single_pendulum", &[log]) else {
        return;
    };
    let report = report(&scratch, &format!("--model pendulum --train {log}"));
    assert!(!names(&report).is_empty());
    assert!(ratio(&report, 0) <= 0.3, "{}", ratio(&report, 0));
    // Without torque, only ratios to the inertia can be determined.
    assert_eq!(report["identifiability"]["held"][0], "C_i");
    assert_eq!(report["logs"]["split"]["end_of_each_log"]["gap_s"], 0.5);
}

#[test]
fn the_loop_closes_on_a_double_pendulum() {
    let [a, b, test] = [
        "sysid_143339.csv",
        "sysid_143601.csv",
        "pendubot_tvlqr_01.csv",
    ];
    let Some(scratch) = with_logs("dfki_double_pendulum_c1", &[a, b, test]) else {
        return;
    };
    let given = format!("--model acrobot --train {a} {b} --test {test}");
    let report = report(&scratch, &given);
    assert_eq!(report["joints"], 2);
    assert!(!names(&report).is_empty());
    assert!(ratio(&report, 1) < 1.0, "{}", ratio(&report, 1));
    let torque = &report["torque"];
    let of_torques = |model: &str| torque[model]["relative"].as_f64().unwrap();
    assert!(of_torques("after") < of_torques("before"), "{torque}");
    let declared = &torque["as_declared"]["rms"];
    assert_eq!(declared.as_array().unwrap().len(), 2);
}

#[test]
fn a_log_that_misled_an_identification_is_told_from_a_good_one() {
    let (poor, good) = ("pd_system_identification.csv", "ddp_pd_tracking.csv");
    let Some(scratch) = with_logs("dfki_simple_pendulum", &[poor, good]) else {
        return;
    };
    let findings = |log: &str| {
        let json = scratch.answers(&format!("audit --json --model pendulum {log}"));
        let audits: Value = serde_json::from_str(&json).unwrap();
        audits[0]["findings"].as_array().unwrap().clone()
    };
    let says = |findings: &[Value], severity: &str, words: &str| {
        let fits = |f: &&Value| {
            f["severity"] == severity && f["text"].as_str().is_some_and(|text| text.contains(words))
        };
        findings.iter().find(fits).is_some()
    };
    let poor = findings(poor);
    for (severity, words) in [
        ("serious", "tau1 chatters: 2.2"),
        ("warning", "disagree with dq1/dt"),
        ("warning", "s of motion, 6 intervals"),
        ("warning", "the motion explains 14."),
        ("warning", "trails tau1 by 15."),
    ] {
        assert!(says(&poor, severity, words), "{words}: {poor:#?}");
    }
    let good = findings(good);
    assert!(good.iter().all(|f| f["severity"] != "serious"), "{good:#?}");
    assert!(!says(&good, "warning", "the motion explains"), "{good:#?}");
}

/// Parameters of the lab's own identification from `pd_system_identification.csv`.
#[test]
fn published_values_fail_on_other_logs_and_the_report_says_which() {
    let [train, test] = ["ddp_pd_tracking.csv", "direct_collocation_pd_tracking.csv"];
    let Some(scratch) = with_logs("dfki_simple_pendulum", &[train, test]) else {
        return;
    };
    let published = "$REPO/docs/rigs/dfki_simple_pendulum_published.toml";
    let logs = format!("--train {train} --test {test}");
    let given = format!("--model {published} {logs} --against {published}");
    let report = report(&scratch, &given);
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
    let log = "acrobot_tvlqr_01.csv";
    let Some(scratch) = with_logs("dfki_double_pendulum_c1", &[log]) else {
        return;
    };
    for number in ["1", "2"] {
        let model = format!("$REPO/docs/rigs/dfki_double_pendulum_c1_model_{number}.toml");
        let error = scratch.json(&format!("evaluate --model {model} --test {log}"));
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

/// A bench moves the rod of a pneumatic cylinder, and a load cell measures the force: two levels, 7.3 N on either side of
/// -148.6 N at 3 bar. The motion says nothing of the rod's mass.
#[test]
fn the_force_of_an_imposed_motion_is_explained() {
    let (model, log) = ("cyl.toml", "circle_3bar.csv");
    let Some(scratch) = with_logs("pneumatic_cylinder", &[model, log]) else {
        return;
    };
    let report = report(&scratch, &format!("--model {model} --train {log}"));
    assert_eq!(report["compared"], "inverse_dynamics");
    assert_eq!(report["verdict"], "explained", "{}", report["reason"]);
    let effects = report["effects"].as_array().unwrap();
    let force = effects
        .iter()
        .find(|effect| effect["name"] == "constant_torque");
    let force = force.expect("a constant force")["parameters"][0]["value"]
        .as_f64()
        .unwrap();
    assert!((force + 148.6).abs() < 1.0, "{force}");
    assert!(
        names(&report)
            .iter()
            .any(|name| *name == "presliding" || name.ends_with("_friction")),
        "{effects:#?}"
    );
    let mass = &report["parameters"][0];
    assert_eq!(mass["name"], "m");
    let mass = mass["value"].as_f64().unwrap();
    assert!((0.02..2.0).contains(&mass), "{mass}");
    let relative = report["torque"]["after"]["relative"].as_f64().unwrap();
    assert!(relative < 0.01, "{relative}");
}

/// A fit of the whole swing is 9 mrad off after 20 s; windows of half a second show no damping, and are 36 mrad off.
#[test]
fn light_damping_of_a_filmed_pendulum_is_found_over_several_swings() {
    let (model, log) = ("pend.toml", "lab1_a.csv");
    let Some(scratch) = with_logs("filmed_pendulum", &[model, log]) else {
        return;
    };
    let report = report(&scratch, &format!("--model {model} --train {log}"));
    let error = &report["error"];
    let horizons = error["horizons_s"].as_array().unwrap();
    let longest = horizons.len() - 1;
    assert!(horizons[longest].as_f64().unwrap() > 19.0, "{horizons:?}");
    let ahead = error["after"]["position_rmse"][longest][0]
        .as_f64()
        .unwrap();
    assert!(ahead < 0.010, "{ahead}");
    let damped = ["quadratic_drag", "viscous_friction", "asymmetric_friction"];
    let found = names(&report);
    assert!(found.iter().any(|name| damped.contains(name)), "{found:?}");
}

/// A geared joint that rests in half of its rows: its friction is named, and nothing that a joint at rest might hide.
#[test]
fn friction_of_a_sticking_joint_is_named_alone() {
    let (model, plant) = ("joint.toml", "plant.toml");
    let Some(scratch) = with_logs("sticking_joint", &[model, plant]) else {
        return;
    };
    for seed in 0..3 {
        scratch.answers(&format!(
            "simulate --plant {plant} --duration 15 --seed {seed} --out {seed}.csv"
        ));
    }
    let report = report(
        &scratch,
        &format!("--model {model} --train 0.csv 1.csv --test 2.csv"),
    );
    let mut found = names(&report);
    found.sort_unstable();
    assert_eq!(found, ["coulomb_friction", "viscous_friction"]);
    assert_eq!(report["verdict"], "explained", "{}", report["reason"]);
    assert_eq!(report["fits"]["after"]["converged"], true);
}
