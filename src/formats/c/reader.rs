use std::fmt::Write;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use super::compiler::{compile, compiler};
use crate::formats::{Answers, Samples, Unread};

const CLIENT: &str = include_str!("../../../docs/clients/c.c");

/// What a header predicts, compiled into a program.
pub(super) fn answers(path: &Path, samples: &Samples) -> Result<Answers, Unread> {
    let io = |error: std::io::Error| Unread::NoReader(format!("no place for a program: {error}"));
    let folder = tempfile::tempdir().map_err(io)?;
    let (source, program) = (folder.path().join("client.c"), folder.path().join("client"));
    std::fs::write(&source, CLIENT).map_err(io)?;
    let upper = guarded(path)?;
    let mut command = compiler();
    command
        .args(["-std=c99", "-O2", "-include"])
        .arg(std::path::absolute(path).map_err(io)?)
        .arg(format!("-DMODEL(name)={}_##name", upper.to_lowercase()))
        .arg(format!("-DJOINTS={upper}_JOINTS"))
        .args([&source, Path::new("-o"), &program, Path::new("-lm")]);
    compile(command)?;
    let said = ask(Command::new(&program), &question(samples)).map_err(io)?;
    read(&said, samples).ok_or_else(|| {
        Unread::Refused(format!(
            "the program from {} prints something else than numbers: {said}",
            path.display()
        ))
    })
}

/// What the macros of a header begin with.
fn guarded(path: &Path) -> Result<String, Unread> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| Unread::Refused(format!("{}: {error}", path.display())))?;
    let mut guards = text
        .lines()
        .filter_map(|line| line.strip_prefix("#ifndef ")?.strip_suffix("_H"));
    guards
        .next()
        .map(str::to_owned)
        .ok_or_else(|| Unread::Refused(format!("{} has no include guard", path.display())))
}

fn question(samples: &Samples) -> String {
    let mut text = format!(
        "{} {} {}\n",
        samples.states.len(),
        samples.held.len(),
        samples.step_s
    );
    let points = samples
        .states
        .iter()
        .zip(&samples.torques)
        .map(|(state, torque)| [state.as_slice(), torque].concat());
    for row in points
        .chain([samples.start.clone()])
        .chain(samples.held.iter().cloned())
    {
        for number in row {
            let _ = write!(text, "{number:?} ");
        }
        text.push('\n');
    }
    text
}

fn ask(mut program: Command, question: &str) -> std::io::Result<String> {
    let mut run = program
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let mut stdin = run.stdin.take().expect("it is piped");
    // The program answers as it reads: both at once, or both wait for ever.
    let question = question.to_owned();
    let writer = std::thread::spawn(move || stdin.write_all(question.as_bytes()));
    let output = run.wait_with_output()?;
    // A program that stops early says so by its answer.
    let _ = writer.join();
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// A line for each point, then one for each step of the rollout.
fn read(said: &str, samples: &Samples) -> Option<Answers> {
    let row = |line: &str| -> Option<Vec<f64>> {
        line.split_whitespace()
            .map(|number| number.parse().ok())
            .collect()
    };
    let rows: Vec<Vec<f64>> = said.lines().map(row).collect::<Option<_>>()?;
    let (points, rollout) = rows.split_at_checked(samples.states.len())?;
    let states = 2 * samples.joints;
    let (next, derivative) = points
        .iter()
        .map(|row| row.split_at_checked(states))
        .collect::<Option<(Vec<_>, Vec<_>)>>()?;
    let owned = |rows: Vec<&[f64]>| Some(rows.into_iter().map(<[f64]>::to_vec).collect());
    Some(Answers {
        next: owned(next),
        derivative: owned(derivative),
        rollout: Some(rollout.to_vec()),
    })
}
