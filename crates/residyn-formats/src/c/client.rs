use std::fmt::Write;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use super::compiler::{compile, compiler};
use crate::{ClientError, Predictions, Samples};

const CLIENT: &str = include_str!("../../../../docs/clients/c.c");

/// The predictions of a header, compiled into a program.
pub(super) fn predict(path: &Path, samples: &Samples) -> Result<Predictions, ClientError> {
    let io = |error: std::io::Error| {
        ClientError::Unavailable(format!("no temporary folder for a program: {error}"))
    };
    let folder = tempfile::tempdir().map_err(io)?;
    let (source, program) = (folder.path().join("client.c"), folder.path().join("client"));
    std::fs::write(&source, CLIENT).map_err(io)?;
    let upper = macro_prefix(path)?;
    let mut command = compiler();
    command
        .args(["-std=c99", "-O2", "-include"])
        .arg(std::path::absolute(path).map_err(io)?)
        .arg(format!("-DMODEL(name)={}_##name", upper.to_lowercase()))
        .arg(format!("-DJOINTS={upper}_JOINTS"))
        .arg(format!("-DSTATES={upper}_STATES"))
        .args([&source, Path::new("-o"), &program, Path::new("-lm")]);
    compile(command)?;
    let printed = run(Command::new(&program), &input(samples)).map_err(io)?;
    parsed(&printed, samples).ok_or_else(|| {
        ClientError::Failed(format!(
            "the program from {} prints something other than numbers: {printed}",
            path.display()
        ))
    })
}

/// The prefix of a header's macros.
fn macro_prefix(path: &Path) -> Result<String, ClientError> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| ClientError::Failed(format!("{}: {error}", path.display())))?;
    let mut guards = text
        .lines()
        .filter_map(|line| line.strip_prefix("#ifndef ")?.strip_suffix("_H"));
    guards
        .next()
        .map(str::to_owned)
        .ok_or_else(|| ClientError::Failed(format!("{} has no include guard", path.display())))
}

fn input(samples: &Samples) -> String {
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

fn run(mut program: Command, input: &str) -> std::io::Result<String> {
    let mut run = program
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let mut stdin = run.stdin.take().expect("it is piped");
    // The program prints while it reads: writing and reading must overlap, or both wait for ever.
    let input = input.to_owned();
    let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let output = run.wait_with_output()?;
    // A program that stops early shows it in its output.
    let _ = writer.join();
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// One line per point, then one per step of the rollout.
fn parsed(printed: &str, samples: &Samples) -> Option<Predictions> {
    let row = |line: &str| -> Option<Vec<f64>> {
        line.split_whitespace()
            .map(|number| number.parse().ok())
            .collect()
    };
    let rows: Vec<Vec<f64>> = printed.lines().map(row).collect::<Option<_>>()?;
    let (points, rollout) = rows.split_at_checked(samples.states.len())?;
    let states = samples.start.len();
    let (next, derivative) = points
        .iter()
        .map(|row| row.split_at_checked(states))
        .collect::<Option<(Vec<_>, Vec<_>)>>()?;
    let owned = |rows: Vec<&[f64]>| Some(rows.into_iter().map(<[f64]>::to_vec).collect());
    Some(Predictions {
        next: owned(next),
        derivative: owned(derivative),
        rollout: Some(rollout.to_vec()),
    })
}
