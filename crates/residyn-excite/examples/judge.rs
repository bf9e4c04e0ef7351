//! `judge MODEL LIMITS DURATION [MOTION.csv]`: what a motion of another tool tells, or what a designed one does, as JSON. The
//! table has the columns `q1..,qd1..,qdd1..` and one row each step of the limits.

use std::path::Path;
use std::time::Instant;

use residyn_core::model::Library;
use residyn_excite::{Designer, Limits, Settings};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, limits, duration, motion @ ..] = arguments.as_slice() else {
        return Err("give MODEL LIMITS DURATION [MOTION.csv]".into());
    };
    let model = Library::built_in().model_from_text(model, &std::fs::read_to_string(model)?)?;
    let limits = Limits::parse(&std::fs::read_to_string(limits)?, Path::new(limits), &model)?;
    let settings = Settings::default();
    let designer = Designer::new(&model, &[], &limits, duration.parse()?, &settings)?;
    let Some(motion) = motion.first() else {
        let start = Instant::now();
        let design = designer.best(1, &|_| ())?;
        let time_s = start.elapsed().as_secs_f64();
        let mut value = serde_json::to_value(&design)?;
        value["time_s"] = time_s.into();
        println!("{value}");
        return Ok(());
    };
    let [q, qd, qdd] = read(motion, model.joints)?;
    let judged = designer.judge([&q, &qd, &qdd])?;
    println!("{}", serde_json::to_string(&judged)?);
    Ok(())
}

/// Position, speed and acceleration of a table, `[joint][row]`.
fn read(path: &str, joints: usize) -> Result<[Vec<Vec<f64>>; 3], Failure> {
    let text = std::fs::read_to_string(path)?;
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(str::parse).collect())
        .collect::<Result<_, _>>()?;
    let column = |name: String| -> Result<Vec<f64>, Failure> {
        let place = names.iter().position(|own| *own == name);
        let place = place.ok_or_else(|| format!("{path} has no column {name}"))?;
        Ok(rows.iter().map(|row| row[place]).collect())
    };
    let channel = |stem: &str| -> Result<Vec<Vec<f64>>, Failure> {
        (1..=joints)
            .map(|joint| column(format!("{stem}{joint}")))
            .collect()
    };
    Ok([channel("q")?, channel("qd")?, channel("qdd")?])
}
