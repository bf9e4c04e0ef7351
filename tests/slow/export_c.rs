//! The compiled C header: its predictions, its Jacobians, and no warnings from any compiler.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use rand::RngExt;
use residyn_core::lanes::Row;
use residyn_core::model::tree::model_text;
use residyn_core::model::{Library, Model};
use residyn_core::sim::{Commands, Hold, Integrator, StepTorque};
use residyn_formats::{ExportModel, Predictions, Samples, find};
use serde_json::json;
use tempfile::TempDir;

use crate::support::catalogue::rng;
use crate::support::clients::{succeeds, there_are};
use crate::support::paths::ours;
use crate::support::predictions::agree;
use crate::support::{exported_models, mechanisms};

/// Every function of formulas, reserved names of C, and text that would end a comment.
const ODD: &str = r#"
[system]
name = "Rig"
about = "not the end: */, nor another beginning: /*, nor ??/"
joints = 1

[parameters]
int = { value = 2.0, unit = "*/", about = "the end \\" }
NAN = { value = 0.5 }
"größe" = { value = 0.25 }

[dynamics]
let.double = "where(q1 < 0.2, atan2(qd1, 1 + q1^2), max(q1, min(qd1, 0.5)))"
let.state = "log(2 + sin(q1)) + abs(qd1)^1.5 + tan(0.3 * tanh(qd1)) + sqrt(1 + cos(q1)^2)"
let.time = "clamp(state, -1, 1) * sign(q1) * exp(-q1^2) - where(qd1, größe, 2)^2"
let.int_ = "(double < time) * (q1 >= 0.1) + where(q1 <= 1, 1, 0)"
qdd1 = "int * double - 3 * state * tanh(qd1) + NAN * time + int_ + tau1 - qd1 + 0.1 * t"
"#;

fn odd() -> ExportModel {
    let library = Library::built_in();
    let system = Model::from_text("rig.toml".as_ref(), ODD, library.effects()).unwrap();
    ExportModel::of_system(&system, Integrator::RK4, 0.01, json!("*/ \\"))
}

/// A chain of five bodies with four joints.
fn linkage() -> ExportModel {
    let file = mechanisms::fixture("linkage_4r.urdf");
    let text = model_text(&mechanisms::read_to(&file, Some("hand")));
    let system = Model::from_text(&file, &text, Library::built_in().effects()).unwrap();
    ExportModel::of_system(&system, Integrator::RK4, 0.005, json!({}))
}

/// A model's header in its own folder.
struct Header {
    name: &'static str,
    model: ExportModel,
    folder: TempDir,
}

impl Header {
    fn path(&self) -> PathBuf {
        self.folder.path().join("model.h")
    }

    /// Arguments for the compilation of every client.
    fn arguments(&self) -> Vec<String> {
        let lower = self.model.name().to_lowercase();
        let upper = lower.to_uppercase();
        vec![
            "-include".into(),
            self.path().to_string_lossy().into_owned(),
            format!("-DMODEL(name)={lower}_##name"),
            format!("-DJOINTS={upper}_JOINTS"),
            format!("-DSTATES={upper}_STATES"),
            format!("-DPARTS={upper}_PARTS"),
        ]
    }

    /// A client compiled with these flags.
    fn program(&self, client: &str, flags: &[&str]) -> PathBuf {
        let program = self.folder.path().join("client");
        let mut command = Command::new("cc");
        command.arg("-std=c99").args(flags).args(self.arguments());
        command.arg(ours(client)).arg("-o").arg(&program).arg("-lm");
        succeeds(&mut command, self.name);
        program
    }

    /// The rows of numbers that a client prints, compiled with these flags.
    fn ask(&self, client: &str, flags: &[&str], question: &str) -> Vec<Vec<f64>> {
        rows(
            Command::new(self.program(client, flags)),
            question,
            self.name,
        )
    }
}

/// The rows of numbers that a program prints.
fn rows(mut program: Command, question: &str, what: &str) -> Vec<Vec<f64>> {
    let mut run = program
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut stdin, question) = (run.stdin.take().unwrap(), question.to_owned());
    let writer = std::thread::spawn(move || stdin.write_all(question.as_bytes()));
    let output = run.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{what}: {program:?} stops\n{said}");
    writer.join().unwrap().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    let row = |line: &str| {
        line.split_whitespace()
            .map(|x| x.parse().unwrap())
            .collect()
    };
    said.lines().map(row).collect()
}

/// Every model's header, or none if a tool is missing.
fn headers(tools: &[&str]) -> Vec<Header> {
    if !there_are(tools) {
        return Vec::new();
    }
    let odd = [("odd", odd())];
    let loose = [exported_models::loose()];
    let all = exported_models::all().into_iter().chain(loose).chain(odd);
    all.map(|(name, model)| written(name, model)).collect()
}

fn written(name: &'static str, model: ExportModel) -> Header {
    let header = Header {
        name,
        model,
        folder: tempfile::tempdir().unwrap(),
    };
    let format = find("c").unwrap();
    format.write(&header.model, &header.path()).unwrap();
    header
}

fn question(samples: &Samples) -> String {
    let (points, steps) = (samples.states.len(), samples.held.len());
    let mut text = format!("{points} {steps} {}", samples.step_s);
    let rows = samples.states.iter().zip(&samples.torques);
    let rows = rows.flat_map(|(state, torque)| [state, torque]);
    for number in rows.chain([&samples.start]).chain(&samples.held).flatten() {
        let _ = write!(text, " {number:?}");
    }
    text
}

const CLIENT: &str = "docs/clients/c.c";

/// The predictions of the client under these flags.
fn predictions(header: &Header, flags: &[&str], samples: &Samples) -> Predictions {
    let rows = header.ask(CLIENT, flags, &question(samples));
    let (points, rollout) = rows.split_at(samples.states.len());
    let (next, derivative) = points
        .iter()
        .map(|row| {
            let (next, derivative) = row.split_at(samples.start.len());
            (next.to_vec(), derivative.to_vec())
        })
        .unzip();
    Predictions {
        next: Some(next),
        derivative: Some(derivative),
        rollout: Some(rollout.to_vec()),
    }
}

#[test]
fn the_compiled_header_predicts_what_the_program_does() {
    let format = find("c").unwrap();
    for header in headers(&["cc"]) {
        let samples = header.model.samples(&mut rng(3)).unwrap();
        let own = header.model.predict(&samples).unwrap();
        let theirs = format.predict(&header.path(), &samples).unwrap();
        agree(header.name, &own, &theirs, 1e-9);
    }
}

/// Every model's header, compiled with flags for its name, predicts single points as the program does.
fn agrees_at_points(seed: u64, flags: impl Fn(&str) -> Vec<String>, tolerance: f64) {
    for header in headers(&["cc"]) {
        let samples = header.model.samples(&mut rng(seed)).unwrap();
        let own = header.model.predict(&samples).unwrap();
        let flags = flags(&header.model.name().to_uppercase());
        let flags: Vec<&str> = flags.iter().map(String::as_str).collect();
        let difference = own.difference(&predictions(&header, &flags, &samples));
        let is_near = difference.pointwise() <= tolerance;
        assert!(is_near, "{} {difference:?}", header.name);
    }
}

#[test]
fn the_header_in_float_agrees_to_single_precision() {
    let float = |name: &str| vec!["-O2".to_owned(), format!("-D{name}_FLOAT")];
    agrees_at_points(4, float, 1e-5);
}

#[test]
fn the_header_has_no_invalid_access_or_undefined_behaviour() {
    let flags = [
        "-g",
        "-fsanitize=address,undefined",
        "-fno-sanitize-recover=all",
    ];
    agrees_at_points(5, |_| flags.map(str::to_owned).to_vec(), 1e-9);
}

#[test]
fn the_header_reads_no_uninitialised_memory() {
    for header in headers(&["cc", "valgrind"]) {
        let mut samples = header.model.samples(&mut rng(5)).unwrap();
        samples.states.truncate(16);
        samples.torques.truncate(16);
        samples.held.truncate(100);
        let mut checked = Command::new("valgrind");
        checked.args(["-q", "--error-exitcode=1"]);
        checked.arg(header.program(CLIENT, &["-g", "-O1"]));
        let printed = rows(checked, &question(&samples), header.name);
        assert_eq!(printed.len(), 116, "{}", header.name);
    }
}

#[test]
fn no_compiler_warns() {
    for header in headers(&["cc", "c++"]) {
        let main = header.folder.path().join("main.c");
        std::fs::write(&main, "int main(void) { return 0; }\n").unwrap();
        let float = format!("-D{}_FLOAT", header.model.name().to_uppercase());
        for precision in ["-DDOUBLE", &float] {
            let strict = [
                "-Wall",
                "-Wextra",
                "-Werror",
                "-pedantic",
                "-Wdouble-promotion",
                precision,
            ];
            for language in [["cc", "-std=c99", "-xc"], ["c++", "-std=c++11", "-xc++"]] {
                let mut command = Command::new(language[0]);
                command
                    .args(&language[1..])
                    .args(strict)
                    .args(header.arguments());
                for source in [main.clone(), ours(CLIENT)] {
                    let mut one = Command::new(language[0]);
                    one.args(command.get_args()).arg("-c").arg(source);
                    one.arg("-o").arg(header.folder.path().join("main.o"));
                    succeeds(&mut one, header.name);
                }
            }
        }
    }
}

#[test]
fn exported_inverse_dynamics_needs_the_same_torques() {
    if !there_are(&["cc"]) {
        return;
    }
    let mut compared = 0;
    let chain = written("linkage", linkage());
    for header in headers(&["cc"]).into_iter().chain([chain]) {
        let model = &header.model;
        let balance = model.system.torque_balance();
        let network = model.prior.is_some() || model.residual.is_some();
        let Some(balance) = balance.filter(|_| !network) else {
            continue;
        };
        let (mut random, n) = (rng(9), model.joints());
        let mut draw = |count: usize, size: f64| -> Vec<f64> {
            (0..count)
                .map(|_| random.random_range(-size..size))
                .collect()
        };
        let motions: Vec<[Vec<f64>; 3]> = (0..100)
            .map(|_| [draw(model.states(), 3.0), draw(n, 10.0), draw(n, 5.0)])
            .collect();
        let mut question = format!("{}", motions.len());
        for number in motions.iter().flatten().flatten() {
            let _ = write!(question, " {number:?}");
        }
        let float = format!("-D{}_FLOAT", model.name().to_uppercase());
        for (flags, tolerance) in [(&["-O2"][..], 1e-12), (&["-O2", &float], 1e-4)] {
            let found = header.ask("tests/clients/inverse.c", flags, &question);
            let wanted = motions.iter().map(|[state, acceleration, torque]| {
                let (values, time) = (balance.values(), vec![0.0]);
                let inputs = [state, torque, &time, acceleration, &values];
                balance.program.eval(&inputs.map(Vec::as_slice).concat())
            });
            for (found, wanted) in found.iter().zip(wanted) {
                let size = wanted.iter().map(|x| x.abs()).fold(1.0, f64::max);
                for (found, wanted) in found.iter().zip(wanted) {
                    assert!((found - wanted).abs() < tolerance * size, "{}", header.name);
                }
            }
        }
        compared += 1;
    }
    assert!(compared > 1, "{compared}");
}

#[test]
fn exported_jacobians_match_finite_differences() {
    for header in headers(&["cc"]) {
        let samples = header.model.samples(&mut rng(6)).unwrap();
        let worst = header.ask("tests/clients/jacobian.c", &["-O2"], &question(&samples));
        assert_eq!(worst.len(), samples.states.len());
        let worst = worst.concat().into_iter().fold(0.0, f64::max);
        assert!(worst <= 1e-6, "{}: {worst:e}", header.name);
    }
}

/// Steps of varying length, so that a delay spans few or many of them.
#[test]
fn filtered_torques_are_exact_for_steps_of_any_length() {
    let filtered = |header: &Header| !header.model.equations.filters.is_empty();
    for header in headers(&["cc"]).into_iter().filter(filtered) {
        let (mut random, n, steps) = (rng(8), header.model.joints(), 200);
        let (mut time, mut tau) = (vec![-1.0], vec![vec![0.0]; n]);
        let (mut now, mut question) = (0.0, format!("{steps}"));
        for _ in 0..steps {
            let length = header.model.step_s * random.random_range(0.6..3.0);
            time.push(now);
            now += length;
            let _ = write!(question, " {length:?}");
            for tau in &mut tau {
                tau.push(random.random_range(-1.0..1.0));
                let _ = write!(question, " {:?}", tau.last().unwrap());
            }
        }
        time.push(now);
        let equations = &header.model.equations;
        let commands = Commands::new(equations, &time[..=steps], &tau);
        let parts = header.model.integrator.substeps();
        let rows = header.ask("tests/clients/acting.c", &[], &question);
        for (k, row) in rows.iter().enumerate() {
            let held: Vec<_> = tau.iter().map(|tau| Row([tau[k + 1]])).collect();
            let ends = [time[k + 1], time[k + 2]].map(|time| Row([time]));
            let acting = StepTorque::new(&Hold::between([&commands], &held, ends, parts)).given;
            for (a, Row([b])) in row.iter().zip(acting) {
                assert!((a - b).abs() < 1e-9, "{} step {k}: {a} {b}", header.name);
            }
        }
    }
}
