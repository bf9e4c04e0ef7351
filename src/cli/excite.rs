use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;
use serde_json::{Value, json};

use super::effect_setting::{EffectSetting, add_effects};
use super::{Answer, Common, inputs, progress, terminal};
use residyn_core::data::Joint;
use residyn_core::digits::amount_of;
use residyn_core::model::{Library, Model};
use residyn_core::plant::Plant;
use residyn_excite::{Design, ExciteError, Expected, Limits, Progress, Settings, design, picture};
use residyn_io::files::{check_room, read_text, write_whole, write_with};
use residyn_io::read_model;

/// Evidence from which an alternative is told apart: the true model then leads by two standard errors with a probability of
/// 95 % (docs/method.md, "Discriminate").
const TOLD: f64 = 53.0;

/// Design a motion within limits that tells a model's parameters, and its alternatives, apart best
#[derive(Debug, Args)]
#[command(
    after_help = "Exit status 1 if the limits allow no motion that tells anything.\n\nExample:\n  residyn excite --model arm.toml --limits limits.toml --duration 10 --out motion.csv --alternative stribeck_friction@2.F_s=0.4"
)]
pub(super) struct Arguments {
    /// Model file, or the name of a built-in system
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// What each joint may do: docs/excite.md has all keys
    #[arg(long, value_name = "FILE")]
    limits: PathBuf,
    /// Length of the motion in s
    #[arg(long, value_name = "S")]
    duration: f64,
    /// Table of the motion to write; its figure is written beside it as SVG
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
    /// An effect that the rig might have besides the model, each an alternative of its own: NAME=VALUE, NAME@JOINT=VALUE or
    /// NAME@JOINT.PARAMETER=VALUE
    #[arg(long, num_args = 1.., value_name = "NAME@JOINT=VALUE")]
    alternative: Vec<EffectSetting>,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let library = arguments.effects.library()?;
    let model = read_model(&arguments.model, &library)?;
    let limits = read_limits(&arguments.limits, &model)?;
    let alternatives: Vec<Model> = (arguments.alternative.iter())
        .map(|setting| with_effect(&model, &library, setting))
        .collect::<Result<_>>()?;
    check_room(&arguments.out)?;
    let start = Instant::now();
    let found = match designed(arguments, &model, &alternatives, &limits) {
        Err(
            error @ (ExciteError::NothingShown | ExciteError::Rest(_) | ExciteError::NotFinite),
        ) => {
            terminal::tell(format!("no motion: {error}"));
            return Ok(Answer::No);
        }
        found => found?,
    };
    let time_s = start.elapsed().as_secs_f64();
    let figure = picture(&model, &limits, &found)?;
    write_with(&arguments.out, |out| found.write_csv(out))?;
    let svg = arguments.out.with_extension("svg");
    write_whole(&svg, figure.as_bytes())?;
    let labels: Vec<String> = arguments
        .alternative
        .iter()
        .map(EffectSetting::label)
        .collect();
    let value = || -> Value {
        json!({
            "out": arguments.out, "figure": svg, "time_s": time_s, "alternatives": labels,
            "design": found,
        })
    };
    let headline = format!(
        "{}: {} rows, {} s, within all limits",
        arguments.out.display(),
        found.time.len(),
        found.duration_s
    );
    let text = text(&headline, &model, &found, &labels, time_s);
    arguments.common.answer(value, &headline, &text)?;
    Ok(Answer::Yes)
}

/// A limits file for this model.
pub(super) fn read_limits(path: &Path, model: &Model) -> Result<Limits> {
    let text = read_text(path).with_context(|| path.display().to_string())?;
    Ok(Limits::parse(&text, path, model)?)
}

/// The model with one effect more.
fn with_effect(model: &Model, library: &Library, setting: &EffectSetting) -> Result<Model> {
    let mut rig = Plant::of_system(model.clone());
    add_effects(&mut rig, library, std::slice::from_ref(setting))?;
    Ok(model.with_effects(rig.effects))
}

fn designed(
    arguments: &Arguments,
    model: &Model,
    alternatives: &[Model],
    limits: &Limits,
) -> Result<Design, ExciteError> {
    let settings = Settings::default();
    let bar = progress::bar(1);
    bar.set_message("motions improved");
    let follow = |Progress { done, all }: Progress| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    };
    let (duration, seed) = (arguments.duration, arguments.common.seed);
    let found = design(
        model,
        alternatives,
        limits,
        duration,
        &settings,
        seed,
        &follow,
    );
    bar.finish_and_clear();
    found
}

/// The answer for people.
fn text(headline: &str, model: &Model, found: &Design, labels: &[String], time_s: f64) -> String {
    let mut text = format!(
        "{headline}\n\nexpected 95 % intervals, from the noise of the limits file alone:\n"
    );
    let rows: Vec<[String; 3]> = found.expected.iter().map(row).collect();
    let width = |k: usize| {
        rows.iter()
            .map(|row| row[k].chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths = [width(0), width(1)];
    for [name, interval, share] in &rows {
        let _ = writeln!(
            text,
            "  {name:0$}  {interval:1$}  {share}",
            widths[0], widths[1]
        );
    }
    if !found.unseen.is_empty() {
        let _ = writeln!(
            text,
            "no motion within the limits shows {}",
            found.unseen.join(", ")
        );
    }
    for (label, evidence) in labels.iter().zip(&found.evidence) {
        let told = match *evidence > TOLD {
            true => "told apart",
            false => "not told apart for certain; a longer motion tells more",
        };
        let _ = writeln!(text, "evidence if there is {label}: {evidence:.1}, {told}");
    }
    let most = found.uses.iter().max_by(|a, b| a.share.total_cmp(&b.share));
    if let Some(most) = most {
        let (share, joint) = (100.0 * most.share, model.joint_label(most.joint));
        let _ = writeln!(
            text,
            "most of a limit: {share:.0} % of the {} of joint {joint}",
            most.quantity
        );
    }
    if let Some(clearance_m) = found.clearance_m {
        let _ = writeln!(text, "least distance: {:.0} mm", 1000.0 * clearance_m);
    }
    let _ = writeln!(
        text,
        "begins and ends at rest at {}; condition number {:.0}; designed in {time_s:.1} s",
        start(found),
        found.condition
    );
    text
}

/// `m_2 +0.5 mx_3`, `1.20 kg (1.19 to 1.21)`, `0.83 %`
fn row(expected: &Expected) -> [String; 3] {
    let (sum, half_width) = (&expected.sum, expected.half_width);
    let ends = [sum.declared - half_width, sum.declared + half_width];
    let part = |(name, weight): &(String, f64)| match *weight == 1.0 {
        true => name.clone(),
        false => format!("{weight:+.3} {name}"),
    };
    let parts: Vec<String> = sum.parts.iter().map(part).collect();
    [
        parts.join(" "),
        amount_of(sum.declared, Some(ends), &sum.unit),
        format!("{:.2} %", 100.0 * half_width / sum.size),
    ]
}

/// `q1 = 0.3, q2 = -1.1`
fn start(found: &Design) -> String {
    let angle = |joint: Joint| format!("{} = {:.3}", joint.name("q"), found.q[joint.index()][0]);
    let all: Vec<String> = Joint::all(found.q.len()).map(angle).collect();
    all.join(", ")
}
