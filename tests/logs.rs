//! Logs as rigs write them: each fault is named, with the lines to paste to fix it, and unusable data are neither used
//! nor silently skipped.

use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;
use std::process::Command;

use residyn::read_model;
use residyn::read_standard_log;
use residyn::{Library, Log, Model, Outcome, Request, Settings, Verdict, close_loop};
use residyn_core::closeloop::{
    Declared, Fitted, Problem, Split, SplitMethod, Unexplained, unexplained,
};
use residyn_core::data::{Columns, Remedy, Severity, audit};
use residyn_core::expr::SignForm;
use residyn_core::model::Origin;
use residyn_core::plant::Plant;
use residyn_io::plant_from_text;
use residyn_io::read_rig_log;
use residyn_io::write_log;
use residyn_report as report;
use residyn_report::{Report, Words, summary};
use serde_json::Value;

use crate::support::catalogue::{catalog, rng};
use crate::support::logs::simulate;
use crate::support::tables::rows;
use crate::support::{Scratch, measured, says};

/// A pendulum with dry friction, thrown so that it turns over.
const RIG: &str = r#"
model = "pendulum"
parameters = { C_g = -17.4, C_i = 4.6 }
sensor = { rate_hz = 100, position_noise = 5e-4, position_step = 1.5e-3 }
excitation = { amplitude = [1.6], band_hz = [0.15, 2.0], tones = 8 }
recording = { logs = 2, duration_s = 12, start = [0, 12] }
effect = [{ name = "coulomb_friction", joint = 1, F_c = 0.2 }]
"#;

fn rig() -> Plant {
    plant_from_text(Path::new("rig.toml"), RIG, &Library::built_in()).unwrap()
}

/// The rig's equations, friction too.
fn whole_model() -> Model {
    rig().declared().with_effects(rig().effects.clone())
}

fn recorded(name: &str, seed: u64) -> Log {
    let mut log = rig().record(&mut rng(seed)).unwrap();
    log.path = name.into();
    log
}

/// A folder with the rig's log, `run.csv`, changed.
fn desk(change: impl Fn(&mut Log)) -> Scratch {
    let scratch = Scratch::new();
    let mut log = recorded("run.csv", 0);
    change(&mut log);
    write_log(&log, scratch.path("run.csv")).unwrap();
    scratch
}

/// A model file of the pendulum, with its declared values and these lines under `[columns]`.
fn write_model(desk: &Scratch, columns: &[String]) {
    let system = include_str!("../models/pendulum.toml");
    let system = system
        .replace("15.0", "-17.4")
        .replace("3.0, unit", "4.6, unit");
    let columns = columns.join("\n");
    desk.file("model.toml", format!("{system}\n[columns]\n{columns}\n"));
}

const CLOSELOOP: &str = "closeloop --json --model pendulum --train run.csv --out out";

/// The findings of this severity from `residyn audit`, whose exit status must say whether some are serious.
fn findings(desk: &Scratch, severity: &str, flags: &str) -> Vec<Value> {
    let output = desk.run(&format!("audit --json run.csv {flags}"));
    let audits: Value = serde_json::from_slice(&output.stdout).unwrap();
    let all = audits[0]["findings"].as_array().unwrap().clone();
    let serious = all.iter().any(|finding| finding["severity"] == "serious");
    assert_eq!(output.status.code(), Some(i32::from(serious)));
    let of_severity = |finding: &Value| finding["severity"] == severity;
    all.into_iter().filter(of_severity).collect()
}

/// Lines to paste: `remedy` of all findings under one key.
fn remedies(findings: &[Value], key: &str) -> Vec<String> {
    let of_one = |finding: &Value| finding["remedy"][key].as_array().cloned();
    let mut lines: Vec<String> = findings
        .iter()
        .filter_map(of_one)
        .flatten()
        .map(|line| line.as_str().unwrap().to_owned())
        .collect();
    lines.dedup();
    lines
}

fn each(values: &mut [f64], change: impl Fn(f64) -> f64) {
    values.iter_mut().for_each(|value| *value = change(*value));
}

fn within_turn(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// What a logger does to the columns of a log: a factor, or turns that are not counted; and words of the finding that
/// names the fault.
const MISREAD: &str = "
time 1e3                      | the time looks like ms
time 1e6                      | the time looks like us
time 1e9                      | the time looks like ns
tau -1                        | tau1 has the opposite sign
qd -1                         | qd1 follows -dq1/dt
q deg                         | q1 looks like deg
qd deg                        | qd1 looks like deg/s
qd rpm                        | qd1 looks like rpm
q deg, qd deg                 | q1 and qd1 look like deg and deg/s
q turn                        | q1 jumps by a full turn (6.28
q turn, q deg                 | q1 jumps by a full turn (360)
qd 0                          | qd1 is 0 rad/s throughout
time 1e6, q turn, tau -1      | the time looks like us
q -1, qd -1                   | tau1
";

fn misread(log: &mut Log, faults: &str) {
    for fault in faults.split(", ") {
        let (column, what) = fault.split_once(' ').unwrap();
        let values = match column {
            "time" => &mut log.time,
            "q" => &mut log.q[0],
            "qd" => &mut log.qd[0],
            _ => &mut log.tau[0],
        };
        let scale = |factor: f64| move |value: f64| factor * value + 0.0;
        match what {
            "turn" => each(values, within_turn),
            "deg" => each(values, f64::to_degrees),
            "rpm" => each(values, scale(30.0 / PI)),
            factor => each(values, scale(factor.parse().unwrap())),
        }
    }
}

#[test]
fn what_is_misread_is_named_and_mended_by_the_lines_to_paste() {
    assert!(findings(&desk(|_| {}), "serious", "").is_empty());
    for [faults, words] in rows(MISREAD) {
        let desk = desk(|log| misread(log, &faults));
        let serious = findings(&desk, "serious", "");
        let named = |finding: &Value| finding["text"].as_str().unwrap().contains(&words);
        assert!(serious.iter().any(named), "{words}: {serious:#?}");
        write_model(&desk, &remedies(&serious, "columns"));
        let left = findings(&desk, "serious", "--model model.toml");
        assert!(left.is_empty(), "{words}: {left:#?}");
    }
}

/// The corrected log is the intended one.
#[test]
fn pasted_lines_give_back_the_log() {
    let desk = desk(|log| {
        each(&mut log.time, |t| 1e9 * t);
        each(&mut log.q[0], |q| within_turn(q).to_degrees());
        each(&mut log.tau[0], |tau| -tau);
    });
    let lines = remedies(&findings(&desk, "serious", ""), "columns");
    write_model(&desk, &lines);
    let model = read_model(desk.path("model.toml"), &Library::built_in());
    let read = read_rig_log(desk.path("run.csv"), 1, &model.unwrap().columns).unwrap();
    let meant = recorded("run.csv", 0);
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
    assert!(near(&read.time, &meant.time) && near(&read.tau[0], &meant.tau[0]));
    assert!(near(&read.q[0], &meant.q[0]));
}

#[test]
fn a_clock_in_nanoseconds_is_refused_at_once_with_its_line() {
    let desk = desk(|log| each(&mut log.time, |t| 1e9 * t));
    let line = r#"[columns] time = { column = "time", unit = "ns" }"#;
    says(&desk.refuses(CLOSELOOP), &[line]);
}

/// A joint whose columns go by their numbers, in a text table and in a matrix of NumPy.
#[test]
fn a_log_without_a_header_is_read_by_the_numbers_of_its_columns() {
    let desk = desk(|_| {});
    let csv = desk.read("run.csv");
    let rows: Vec<&str> = csv.lines().skip(1).collect();
    let plain = desk.file("plain.txt", rows.join("\n").replace(',', "  "));
    let numbers = rows.iter().flat_map(|row| row.split(','));
    let numbers = numbers.flat_map(|cell| cell.parse::<f64>().unwrap().to_le_bytes());
    let head = format!(
        "{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 4), }}",
        rows.len()
    );
    let length = u16::try_from(head.len()).unwrap().to_le_bytes();
    let parts: [&[u8]; 4] = [
        b"\x93NUMPY\x01\x00",
        &length,
        head.as_bytes(),
        &numbers.collect::<Vec<u8>>(),
    ];
    let matrix = desk.file("matrix.npy", parts.concat());
    write_model(
        &desk,
        &["time = 1".into(), "q = [2]\nqd = [3]\ntau = [4]".into()],
    );
    let columns = read_model(desk.path("model.toml"), &Library::built_in())
        .unwrap()
        .columns;
    let wanted = read_rig_log(desk.path("run.csv"), 1, &Columns::default()).unwrap();
    for name in [plain, matrix] {
        let read = read_rig_log(desk.path(&name), 1, &columns).unwrap();
        assert!(
            read.q == wanted.q && read.qd == wanted.qd && read.tau == wanted.tau,
            "{name}"
        );
    }
    let said = desk.refuses("audit --model pendulum plain.txt");
    says(
        &said,
        &[
            "plain.txt, line 1",
            "time = 1, q = [2], qd = [3], tau = [4]",
        ],
    );
    // A joint without a drive has no column.
    write_model(&desk, &[r#"tau = [""]"#.into()]);
    let model = read_model(desk.path("model.toml"), &Library::built_in()).unwrap();
    let passive = read_rig_log(desk.path("run.csv"), 1, &model.columns).unwrap();
    assert!(passive.tau[0].iter().all(|torque| *torque == 0.0));
    let note = "joint 1 has no column of `tau`: read as a joint without a drive";
    assert!(
        passive.notes.iter().any(|said| said == note),
        "{:?}",
        passive.notes
    );
    write_model(&desk, &[r#"q = [""]"#.into()]);
    says(
        &desk.refuses("check model.toml"),
        &["only a joint without a drive"],
    );
    write_model(&desk, &["q = [0]".into()]);
    says(
        &desk.refuses("check model.toml"),
        &["columns are counted from 1"],
    );
}

#[test]
fn velocities_come_from_the_angles_where_a_log_has_none() {
    let desk = desk(|_| {});
    let without = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        [cells[0], cells[1], cells[3]].join(",") + "\n"
    };
    let text: String = desk.read("run.csv").lines().map(without).collect();
    let path = desk.file("run.csv", text);
    assert!(findings(&desk, "serious", "").is_empty());
    let read = read_standard_log(path).unwrap();
    let exact = recorded("run.csv", 0);
    let off = read.qd[0]
        .iter()
        .zip(&exact.qd[0])
        .map(|(a, b)| (a - b).powi(2));
    let rms = (off.sum::<f64>() / exact.rows() as f64).sqrt();
    // The logged velocity is a backward difference, half a step late and with the noise of two readings.
    assert!(rms < 0.6, "{rms} rad/s beside up to 12");
}

#[test]
fn a_reading_that_jumps_is_placed_and_can_be_left_out() {
    let desk = desk(|log| log.q[0][600] += 50.0);
    let warnings = findings(&desk, "warning", "");
    let spans = remedies(&warnings, "leave_out");
    assert_eq!(spans, ["run.csv@5.995-6.045"], "{warnings:#?}");
    write_model(&desk, &[]);
    let error = |more: &str| desk.evaluated(&format!("--model model.toml --test run.csv {more}"));
    let (with, without) = (error(""), error(&format!("--leave-out {}", spans[0])));
    assert!(with > 1.0 && without < 0.3, "{with} {without}");
}

/// A fit of the rig's equations to logs as fits read them, and its unexplained residual.
fn left(logs: &[Log], model: &Model) -> (Fitted, Unexplained) {
    let settings = Settings::default();
    let logs: Vec<Log> = logs.iter().map(|log| log.for_fits(0.5)).collect();
    let nothing = Library::empty();
    let problem = Problem::new(model, &nothing, &logs, &settings);
    let Declared { problem, fitted } = problem.fit_declared().unwrap();
    let left = unexplained(&problem, &[], &fitted, &fitted, &mut rng(0));
    (fitted, left)
}

fn friction(fitted: &Fitted) -> f64 {
    fitted.model.effects[0].values[0].0
}

#[test]
fn single_readings_that_jump_are_masked_in_fits() {
    let mut logs = [recorded("a.csv", 1), recorded("b.csv", 2)];
    let (clean, nothing) = left(&logs, &whole_model());
    assert!(!nothing.is_significant(), "{nothing:?}");
    logs[0].q[0][600] += 50.0;
    logs[1].q[0][300] -= 2.0;
    let (masked, nothing) = left(&logs, &whole_model());
    assert!(!nothing.is_significant(), "{nothing:?}");
    let off = friction(&masked) / friction(&clean) - 1.0;
    assert!(
        off.abs() < 0.01,
        "{} {}",
        friction(&masked),
        friction(&clean)
    );
}

/// The log without the rows that `dropped` selects.
fn thinned(log: &Log, dropped: impl Fn(usize) -> bool) -> Log {
    let rows: Vec<usize> = (0..log.rows()).filter(|row| !dropped(*row)).collect();
    let of = |values: &Vec<f64>| rows.iter().map(|row| values[*row]).collect::<Vec<f64>>();
    let all = |channels: &[Vec<f64>]| channels.iter().map(of).collect::<Vec<_>>();
    Log {
        time: of(&log.time),
        q: all(&log.q),
        qd: all(&log.qd),
        tau: all(&log.tau),
        ..log.clone()
    }
}

#[test]
fn dropped_rows_leave_nothing_unexplained() {
    let dropped = |row: usize| row > 0 && ((row * 7919) % 47 == 3 || (row * 104_729) % 211 < 2);
    let logs: Vec<Log> = (1..4).map(|seed| recorded("a.csv", seed)).collect();
    let thin: Vec<Log> = logs.iter().map(|log| thinned(log, dropped)).collect();
    let missing = audit(&thin[0], &Columns::default()).dropped_rows;
    assert_eq!(missing, logs[0].rows() - thin[0].rows());
    let (whole, _) = left(&logs, &whole_model());
    let (found, nothing) = left(&thin, &whole_model());
    assert!(!nothing.is_significant(), "{nothing:?}");
    let off = friction(&found) / friction(&whole) - 1.0;
    assert!(
        off.abs() < 0.05,
        "{} {}",
        friction(&found),
        friction(&whole)
    );
    // A missing effect is still seen.
    let (_, something) = left(&thin, &rig().declared());
    assert!(something.is_significant(), "{something:?}");
}

/// Closing the loop with an empty library, so that nothing can be found.
fn closed(model: &Model, train: Vec<Log>, test: Vec<Log>) -> Outcome {
    let library = Library::empty();
    let request = Request::new(model, &library, Split::given(train, test));
    close_loop(request, &mut rng(0), &()).unwrap()
}

#[test]
fn a_push_by_hand_is_reported_with_its_range() {
    let mut pushed = recorded("pushed.csv", 1);
    // A force that is in no column.
    pushed.tau[0][500..540]
        .iter_mut()
        .for_each(|tau| *tau -= 3.0);
    let outcome = closed(
        &whole_model(),
        vec![pushed, recorded("b.csv", 2)],
        vec![recorded("c.csv", 3)],
    );
    let audits = &outcome.given.audits;
    let spans = |log: &str| {
        let audit = audits.iter().find(|audit| audit.log == log).unwrap();
        let pushes = audit
            .findings
            .iter()
            .filter(|f| f.text.contains("additional force"));
        pushes
            .map(|push| (push.spans_s[0], push.remedy.clone()))
            .collect::<Vec<_>>()
    };
    let found = spans("pushed.csv");
    assert_eq!(found.len(), 1, "{found:?}");
    let ([from, to], remedy) = &found[0];
    assert!(
        (4.7..5.1).contains(from) && (5.3..5.7).contains(to),
        "{from} {to}"
    );
    assert!(matches!(remedy, Some(Remedy::LeaveOut(spans)) if spans[0].starts_with("pushed.csv@")));
    assert!(spans("b.csv").is_empty() && spans("c.csv").is_empty());
}

#[test]
fn a_rig_at_rest_is_inconclusive() {
    let still: [fn(usize) -> f64; 2] = [
        |_| 0.3,
        // An encoder that flickers between two steps.
        |row| 0.3 + 1.5e-3 * f64::from(u8::from((row * 7919) % 10 == 0)),
    ];
    for angle in still {
        let desk = desk(|log| {
            (0..log.rows()).for_each(|row| log.q[0][row] = angle(row));
            log.qd[0].fill(0.0);
            log.tau[0].fill(0.1);
        });
        let output = desk.run(CLOSELOOP);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{errors}");
        says(&errors, &["joint 1 moves by"]);
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(report["verdict"], "inconclusive");
        says(report["reason"].as_str().unwrap(), &["no joint moves"]);
        assert_eq!(report["effects"], Value::Array(vec![]));
    }
}

/// The horizons of the report for one log of this length, without test logs, and those that it omits.
fn horizons(duration_s: f64) -> [Vec<f64>; 2] {
    let mut plant = rig();
    plant.recording.duration_s = duration_s;
    let log = plant.record(&mut rng(0)).unwrap();
    let (library, model) = (Library::empty(), whole_model());
    let request = Request::of(&model, &library, vec![log]);
    let outcome = close_loop(request, &mut rng(0), &()).unwrap();
    if duration_s < 5.0 {
        assert_eq!(outcome.verdict, Verdict::Inconclusive);
    }
    let horizons = &outcome.errors.after.horizons;
    let scored = horizons.iter().map(|errors| errors.horizon_s).collect();
    [scored, outcome.given.unscored_s]
}

#[test]
fn one_short_log_is_split_so_that_it_can_be_judged() {
    assert_eq!(horizons(12.0), [vec![0.1, 0.5, 1.0], vec![]]);
    assert_eq!(horizons(3.2), [vec![0.1, 0.5], vec![1.0]]);
    assert_eq!(horizons(1.6), [vec![0.1], vec![0.5, 1.0]]);
    let split = Split::of(vec![recorded("a.csv", 0)], &Settings::default().split);
    let SplitMethod::EndOfEachLog { share, .. } = split.method else {
        panic!("{:?}", split.method);
    };
    assert!((share - 0.25).abs() < 1e-9, "{share}");
}

#[test]
fn a_log_too_short_for_any_test_says_what_to_give() {
    let desk = desk(|log| *log = thinned(log, |row| row > 60));
    says(&desk.refuses(CLOSELOOP), &["--test"]);
}

#[test]
fn a_log_may_come_from_standard_input() {
    let desk = desk(|_| ());
    let piped = fs::File::open(desk.path("run.csv")).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_residyn"));
    let output = command.args(["audit", "--json", "-"]).stdin(piped).output();
    let audits: Value = serde_json::from_slice(&output.unwrap().stdout).unwrap();
    let rows = read_standard_log(desk.path("run.csv")).unwrap().rows();
    assert_eq!(
        (&audits[0]["log"], &audits[0]["rows"]),
        (&"-".into(), &rows.into())
    );
}

/// Whether the audit calls a column of a log misread.
fn is_called_misread(log: &Log, columns: &Columns) -> Option<String> {
    let mut findings = audit(log, columns).findings.into_iter();
    let misread = findings.find(|finding| {
        finding.severity == Severity::Serious && matches!(finding.remedy, Some(Remedy::Columns(_)))
    });
    misread.map(|finding| format!("{}: {finding}", log.path.display()))
}

#[test]
fn serious_findings_stand_before_the_answer() {
    let mut opposite = recorded("opposite.csv", 1);
    each(&mut opposite.tau[0], |tau| -tau);
    let outcome = closed(&whole_model(), vec![opposite], vec![recorded("b.csv", 2)]);
    let report = Report::new(&outcome, &Origin::of_seed(0));
    let words = Words::default();
    let printed = summary(&report, &outcome.seconds, Path::new("report"), &[], &words);
    assert!(
        printed.starts_with("Serious, to be fixed first: opposite.csv: "),
        "{printed}"
    );
    let whole = printed.split_whitespace().collect::<Vec<_>>().join(" ");
    let mended =
        r#"tau1 has the opposite sign ([columns] tau = [{ column = "tau1", factor = -1 }])"#;
    assert!(whole.contains(mended), "{printed}");
}

#[test]
fn a_test_log_that_was_fitted_is_said_to_be_no_test() {
    let run = || vec![recorded("run.csv", 1)];
    let tests = vec![recorded("again.csv", 1), recorded("b.csv", 2)];
    let outcome = closed(&whole_model(), run(), tests);
    let report = Report::new(&outcome, &Origin::of_seed(0));
    let words = Words::default();
    let fitted = "again.csv was fitted as well: its error says how well the models fit, not how well they predict.";
    let shown = [
        report::text(&report),
        report::page(&report),
        summary(&report, &[], Path::new("report"), &[], &words),
    ];
    for shown in shown {
        let whole = shown.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(whole.contains(fitted), "{shown}");
        assert!(!whole.contains("nothing was fitted"), "{shown}");
    }
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(
        json["error"]["fitted_logs"],
        serde_json::json!(["again.csv"])
    );
    let apart = closed(&whole_model(), run(), vec![recorded("b.csv", 2)]);
    let report = Report::new(&apart, &Origin::of_seed(0));
    assert!(report::page(&report).contains("to which nothing was fitted"));
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["error"]["fitted_logs"], Value::Null);
}

mod slow {
    use super::*;

    /// The logs are as their rigs wrote them, in the units and with the signs that their converters document.
    #[test]
    fn no_measured_log_is_called_misread() {
        let sets = [
            "dfki_simple_pendulum",
            "dfki_double_pendulum_a0",
            "dfki_double_pendulum_c0",
            "dfki_double_pendulum_c1",
            "multiarm_single_pendulum",
            "kuka_lwr4",
            "panda",
            "schunk_lwa4p",
            "ur10",
        ];
        let mut called = Vec::new();
        for folder in sets.into_iter().filter_map(measured) {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.extension().is_some_and(|extension| extension == "csv") {
                    let log = read_standard_log(&path).unwrap();
                    called.extend(is_called_misread(&log, &Columns::default()));
                }
            }
        }
        assert!(called.is_empty(), "{called:#?}");
    }

    #[test]
    fn no_simulated_log_is_called_misread() {
        let cases = catalog(SignForm::Smooth { width: 0.01 });
        let mut called = Vec::new();
        for (case, seed) in cases.iter().zip(0..) {
            let (model, values) = (&case.dynamics, case.dynamics.values());
            let motion = vec![0.4; 2 * model.joints];
            let start = [motion, model.internal_starts(&values)].concat();
            let mut log = simulate(&case.dynamics, &start, 3.0, 1500, seed);
            log.path = case.name.clone().into();
            let runs_away = log.q.iter().flatten().any(|q| !(q.abs() < 1e3));
            // No spring winds up over turns: an apparent one is an angle in degrees. A position loop, whose targets are taken for
            // torques here, is a spring.
            let turns = log.q.iter().flatten().any(|q| q.abs() > TAU);
            let has_spring = ["joint_spring", "cable_hysteresis", "servo"];
            let is_wound = turns && has_spring.iter().any(|spring| case.name.contains(spring));
            // A motor on a soft spring swings against torques that are slower than its resonance.
            let swings = case.name.contains("joint_elasticity");
            if !runs_away && !is_wound && !swings {
                called.extend(is_called_misread(&log, &Columns::default()));
            }
        }
        assert!(called.is_empty(), "{called:#?}");
    }
}
