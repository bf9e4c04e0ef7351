//! `residyn monitor`: what has changed on a running machine.

use std::process::Stdio;

use serde_json::Value;

use crate::support::{Scratch, says};

const LINK: &str = r#"
[system]
name = "link"
about = "a hanging link with dry friction"
joints = 1

[parameters]
J = { value = 0.2, unit = "kg m^2", positive = true, about = "inertia" }
G = { value = 3.0, unit = "N m", positive = true, about = "weight times arm" }
F = { value = 0.15, unit = "N m", positive = true, about = "dry friction" }

[dynamics]
mass = [["J"]]
bias = ["G*sin(q1) + F*sign(qd1)"]
"#;

/// A folder with the link's model and two minutes of it when it is well, `healthy.csv`; in `worn.csv` its friction is half as large
/// again in two further minutes.
fn machine() -> Scratch {
    let scratch = Scratch::new();
    scratch.file("link.toml", LINK);
    scratch.file("later.toml", LINK.replace("value = 0.15", "value = 0.225"));
    scratch.answers("simulate --plant link.toml --duration 120 --seed 1 --out healthy.csv");
    scratch.answers("simulate --plant later.toml --duration 120 --seed 2 --out later.csv");
    let later = scratch.read("later.csv");
    let mut worn = scratch.read("healthy.csv");
    for row in later.lines().skip(2) {
        let (time, rest) = row.split_once(',').unwrap();
        worn += &format!("{:.2},{rest}\n", time.parse::<f64>().unwrap() + 120.0);
    }
    scratch.file("worn.csv", worn);
    scratch
}

#[test]
fn friction_that_grew_is_named_with_its_size_and_its_time() {
    let scratch = machine();
    let text = scratch.answers("monitor --model link.toml --healthy 60 healthy.csv");
    says(
        &text,
        &[
            "0 alarm(s)",
            "F of joint 1: a change by",
            "is seen within an hour",
        ],
    );
    let output = scratch.run("monitor --model link.toml --healthy 60 --json worn.csv");
    assert_eq!(output.status.code(), Some(1));
    let lines = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<Value> = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let [alarm, summary] = lines.as_slice() else {
        panic!("{lines:?}");
    };
    assert_eq!((&alarm["name"], &alarm["joint"]), (&"F".into(), &1.into()));
    let [low, high] = [0, 1].map(|end| alarm["estimate"]["ci95"][end].as_f64().unwrap());
    assert!(
        low < 0.5 && 0.5 < high && high - low < 0.1,
        "{low} to {high}"
    );
    let since_s = alarm["since_s"].as_f64().unwrap();
    assert!((since_s - 120.0).abs() < 3.0, "{since_s}");
    assert!(alarm["time_s"].as_f64().unwrap() < 150.0);
    assert_eq!(summary["alarms"].as_array().unwrap().len(), 1);
}

#[test]
fn rows_come_through_a_pipe_as_csv_or_as_json() {
    let scratch = machine();
    let text = scratch.read("healthy.csv");
    let objects: String = (text.lines().skip(1))
        .map(|row| {
            let numbers: Vec<&str> = row.split(',').collect();
            let [time, q, qd, tau] = numbers[..] else {
                panic!("{row}");
            };
            format!("{{\"time\":{time},\"q\":[{q}],\"qd\":[{qd}],\"tau\":[{tau}]}}\n")
        })
        .collect();
    let summaries = [text, objects].map(|rows| {
        let mut command = scratch.command("monitor --model link.toml --healthy 60 --json -");
        let mut child = (command.stdin(Stdio::piped()).stdout(Stdio::piped()))
            .spawn()
            .unwrap();
        let mut pipe = child.stdin.take().unwrap();
        std::io::Write::write_all(&mut pipe, rows.as_bytes()).unwrap();
        drop(pipe);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        String::from_utf8(output.stdout).unwrap()
    });
    assert_eq!(summaries[0], summaries[1]);
}

#[test]
fn bad_rows_and_short_logs_are_told() {
    let scratch = machine();
    let text = scratch.read("healthy.csv");
    let short: String = text
        .lines()
        .take(500)
        .map(|line| line.to_owned() + "\n")
        .collect();
    scratch.file("short.csv", short);
    let line = "monitor --model link.toml --healthy 60";
    says(
        &scratch.refuses(&format!("{line} short.csv")),
        &[
            "ends after 499 row(s), before the healthy stretch of 60 s does",
            "--healthy",
        ],
    );
    let mut rows: Vec<&str> = text.lines().collect();
    rows[300] = "2.99,x,0,0";
    scratch.file("bad.csv", rows.join("\n"));
    says(
        &scratch.refuses(&format!("{line} bad.csv")),
        &["bad.csv", "column \"q1\"", "\"x\" is not a number"],
    );
    rows[300] = "1.0,0,0,0";
    scratch.file("back.csv", rows.join("\n"));
    says(&scratch.refuses(&format!("{line} back.csv")), &["back.csv"]);
}
