//! What closing the loop prints in a terminal: the full answer in lines of eighty characters, thirty of them if there
//! is not very much to say.

use std::path::Path;

use residyn_report::{Report, Words, summary};
use serde_json::{Value, json};

use crate::support::{Scratch, says};

const BLOCKS: [char; 2] = ['█', '▁'];

fn fits(said: &str) {
    assert!(said.lines().count() <= 30, "{said}");
    is_narrow(said);
}

fn is_narrow(said: &str) {
    let wide = said.lines().find(|line| line.chars().count() > 80);
    assert_eq!(wide, None, "{said}");
}

#[test]
fn the_answer_fits_a_terminal_for_a_pendulum_and_for_an_arm() {
    let scratch = Scratch::new();
    let rig = "--model pendulum --train $REPO/tests/fixtures/logs/pendulum.csv";
    let said = scratch.succeeds(&format!("closeloop --curves --out r {rig}"));
    fits(said.rsplit_once("\nTook ").unwrap().0);
    says(
        &said,
        &[
            "The model lacks coulomb_friction on joint 1",
            "What is missing?\n  coulomb_friction on joint 1: -F_c1 * sign(qd1)\n    F_c1 = 0.1",
            "How much better is it? Open-loop errors on the test logs, rad\n",
            "as written     fitted  with effects\n  joint 1, 0.1 s ahead",
            "Can I trust it?\n",
            "What next? ",
            "report.html; model and plots are next to it\n",
        ],
    );
    assert!(BLOCKS.iter().all(|block| said.contains(*block)), "{said}");
    let report = scratch.read_json("r/report.json");
    for compared in ["output_error", "inverse_dynamics"] {
        let value = arm(report.clone(), compared);
        let drawn = vec![String::from("  a curve"); 3];
        let of = |value: Value| {
            let report: Report = serde_json::from_value(value).unwrap();
            let said = summary(&report, &[], Path::new("report"), &drawn, &Words::default());
            is_narrow(&said);
            // Sentences are never cut.
            assert!(!said.contains(".."), "{said}");
            said
        };
        let is_whole = |said: &str, sentence: String| {
            let words = said.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(
                words.contains(sentence.trim()),
                "{sentence} is missing in\n{said}"
            );
        };
        let mut mended = value.clone();
        mended["audit"][0]["findings"] = json!([]);
        let long = LONG.repeat(12);
        is_whole(
            &of(mended),
            format!("to rule out stribeck_friction: {long}"),
        );
        let said = of(value);
        is_whole(&said, format!("report.md): pendulum.csv: {long}"));
        let held = held().join(", ");
        is_whole(
            &said,
            format!("held, since the logs do not determine them: {held}"),
        );
        let begins = "Serious, to be fixed first (and 1 more";
        assert!(said.starts_with(begins), "{said}");
        let last = match compared {
            "output_error" => "and 3 more joints in report.md",
            _ => "joint 7 (wrist_flange_joint)",
        };
        says(
            &said,
            &[
                "and 5 more effects in report.md",
                last,
                "not ruled out: ",
                "What next? ",
            ],
        );
    }
}

const LONG: &str = "a reason that goes on and on ";

/// Parameters that the logs do not determine.
fn held() -> Vec<String> {
    (1..=30).map(|k| format!("m_{k}")).collect()
}

/// A report of an arm of seven joints with much to say, from one of a pendulum.
fn arm(mut report: Value, compared: &str) -> Value {
    let names = [
        "base",
        "shoulder",
        "elbow",
        "forearm",
        "wrist",
        "hand",
        "wrist_flange",
    ];
    report["joints"] = json!(7);
    report["joint_names"] = names.iter().map(|name| format!("{name}_joint")).collect();
    report["prismatic"] = vec![false; 7].into();
    report["compared"] = json!(compared);
    let errors = |relative: f64| json!({"rms": vec![1.5; 7], "relative": relative});
    report["torque"] = json!({
        "as_declared": errors(0.4), "before": errors(0.2), "after": errors(0.1), "reduction_ci95": [0.4, 0.6]
    });
    for model in ["declared", "before", "after"] {
        for horizon in report["error"][model]["position_rmse"]
            .as_array_mut()
            .unwrap()
        {
            *horizon = vec![0.0123; 7].into();
        }
    }
    let before = report["error"]["before"].clone();
    let mut other = before.clone();
    other["name"] = json!("a/model/of/somebody/else.toml");
    report["error"]["against"] = json!([other, other, other]);
    report["effects"] = vec![report["effects"][0].clone(); 9].into();
    let long = LONG.repeat(12);
    report["reason"] = json!(long);
    let found = json!({"severity": "serious", "text": long});
    let other = json!({"severity": "serious", "text": "another"});
    report["audit"][0]["findings"] = json!([found, other]);
    report["identifiability"]["held"] = held().into();
    let rival = json!({
        "effects": [{"name": "x", "joint": 1, "label": "x on joint 1"}], "title": "stribeck_friction",
        "place": "1", "reason": long, "experiment": long, "separation": null
    });
    report["alternatives"] = json!([rival, rival, rival, rival]);
    report
}
