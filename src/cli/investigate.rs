use std::fmt::Write;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use clap::Args;
use indicatif::ProgressBar;
use serde_json::{Value, json};

use super::call::{Begun, files};
use super::elsewhere::Elsewhere;
use super::excite::read_limits;
use super::{Answer, Common, inputs, interrupt, progress, terminal};
use residyn_core::closeloop::{Progress, Stage};
use residyn_core::data::{Joint, Quantity};
use residyn_core::model::{Call, Model, Origin};
use residyn_excite::Limits;
use residyn_investigate::{
    Choice, Choose, Designed, Ended, Investigated, Investigation, Named, Purpose, Random, Region,
    Round, Span, Watch,
};
use residyn_io::files::read_text;
use residyn_io::read_model;
use residyn_io::runs::{Identity, RunFolder};
use residyn_plants::Controlled;
use residyn_report::{self as report, ResultsPage};

/// Find what a model lacks on a plant: design a motion, play it, close the loop, choose the next one by what is still open
///
/// It ends when every name is established and nothing significant is left, or when nothing within the limits would tell more. The
/// same command resumes an investigation that was interrupted.
#[derive(Debug, Args)]
#[command(
    after_help = "Exit status 1 if something is still open.\n\nExample:\n  residyn investigate --plant exec:\"python my_rig.py\" --model rig.toml --limits limits.toml --motion 120s --out found"
)]
pub(super) struct Arguments {
    /// Plant file, or the name of a built-in plant or system; or a plant in another process, exec:COMMAND or tcp:HOST:PORT
    #[arg(long, value_name = "NAME")]
    plant: PathBuf,
    #[command(flatten)]
    elsewhere: Elsewhere,
    /// The declared model: a model file, or the name of a built-in system
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// What each joint may do: docs/excite.md has all keys
    #[arg(long, value_name = "FILE")]
    limits: PathBuf,
    /// Most motion in all: 90s, 2min
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    motion: f64,
    /// Motion of one run
    #[arg(long, value_name = "TIME", default_value = "8s", value_parser = seconds)]
    run: f64,
    /// Time after which the search for effects after a run stops as it stands: 90s, 10min, 2h
    #[arg(long, value_name = "TIME", default_value = "10min", value_parser = humantime::parse_duration)]
    budget: Duration,
    /// Draw motions at random within the limits, as a comparison
    #[arg(long)]
    random_motions: bool,
    /// Folder for the logs of all runs, the report and the model
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

/// A length of time in s.
fn seconds(text: &str) -> Result<f64, humantime::DurationError> {
    humantime::parse_duration(text).map(|time| time.as_secs_f64())
}

/// The folder of the last report within that of an investigation, and the results beside it.
const REPORT: &str = "report";
const RESULTS: &str = "investigation.json";

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let begun = Begun::now();
    let library = arguments.effects.library()?;
    let model = read_model(&arguments.model, &library)?;
    let named = [
        arguments.model.clone(),
        arguments.limits.clone(),
        arguments.plant.clone(),
    ];
    let read = files("input", &named)?;
    let plant = arguments.elsewhere.open(&arguments.plant, &library)?;
    let limits = limits(arguments, &model, &plant)?;
    let folder = RunFolder::open(&arguments.out)?;
    let identity = identity(arguments, &model)?;
    folder.claim(&identity)?;
    let path = folder.path().display().to_string();
    let _orderly = interrupt::orderly(&folder, move || {
        format!("{path} keeps all runs; the same command goes on")
    });
    let choose: &dyn Choose = match arguments.random_motions {
        true => &Random,
        false => &Designed,
    };
    let investigation = Investigation {
        model: &model,
        library: &library,
        plant: &plant,
        limits: &limits,
        motion_s: arguments.motion,
        run_s: arguments.run,
        choose,
        seed: arguments.common.seed,
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few runs
    let bar = progress::bar((arguments.motion / arguments.run) as usize);
    let told = Told {
        bar: &bar,
        budget: arguments.budget,
        closing_since: Mutex::new(Instant::now()),
    };
    let found = investigation.carry_out(&folder, &told)?;
    bar.finish_and_clear();
    let value = value(&found, &identity.config, arguments.common.seed);
    let call = begun.call(&read);
    write(arguments, &folder, &model, &found, &value, &call)?;
    let text = text(&found, &model, arguments);
    arguments
        .common
        .answer(|| &value, headline(&found), &text)?;
    Ok(Answer::of(found.ended == Ended::Settled))
}

/// The limits file, in the steps of the plant.
fn limits(arguments: &Arguments, model: &Model, plant: &Controlled) -> Result<Limits> {
    let mut limits = read_limits(&arguments.limits, model)?;
    if let Some(description) = plant.description() {
        limits.step_s = description.step_s;
    }
    Ok(limits)
}

fn identity(arguments: &Arguments, model: &Model) -> Result<Identity> {
    let limits =
        read_text(&arguments.limits).with_context(|| arguments.limits.display().to_string())?;
    Ok(Identity {
        command: "investigate".to_owned(),
        seed: arguments.common.seed,
        config: json!({
            "plant": arguments.plant,
            "model": model.declaration,
            "limits": limits,
            "run_s": arguments.run,
            "random_motions": arguments.random_motions,
        }),
        inputs: [].into(),
    })
}

/// Tells what is played and what was found, line by line, counts the runs that were allowed, and ends a search whose time is spent.
struct Told<'b> {
    bar: &'b ProgressBar,
    budget: Duration,
    closing_since: Mutex<Instant>,
}

impl Watch for Told<'_> {
    fn plays(&self, run: usize, choice: &Choice) {
        let (purpose, duration_s) = (purpose(&choice.purpose), choice.design.duration_s);
        let line = format!("run {run}: {duration_s} s {purpose}");
        self.bar.suspend(|| terminal::say(line));
        self.bar.set_message("runs; playing");
    }

    fn ended(&self, round: &Round) {
        let line = format!("run {}: {}", round.run, answer(round));
        self.bar.suspend(|| terminal::say(line));
        self.bar.inc(1);
        self.bar.set_message("runs; designing the next");
    }

    fn closes(&self, progress: &Progress<'_>) {
        if progress.stage == Stage::Audit {
            *self.since() = Instant::now();
        }
        self.bar
            .set_message(format!("runs; closing the loop: {}", progress.text));
    }

    fn has_to_end(&self) -> bool {
        self.since().elapsed() >= self.budget
    }
}

impl Told<'_> {
    fn since(&self) -> MutexGuard<'_, Instant> {
        self.closing_since
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

fn purpose(purpose: &Purpose) -> String {
    match purpose {
        Purpose::Fast => "as fast as the limits allow, to determine parameters".into(),
        Purpose::Slow => "slowly, to determine parameters and friction".into(),
        Purpose::Tell { from } => format!("to tell whether there is {}", names(from)),
        Purpose::Random => "at random within the limits".into(),
    }
}

fn names(named: &[Named]) -> String {
    let all = named
        .iter()
        .map(|Named { name, joint }| format!("{name}@{joint}"));
    all.collect::<Vec<_>>().join(", ")
}

/// `coulomb_friction@1, actuator_delay@1; open: viscous_friction@1`
fn answer(round: &Round) -> String {
    let found = match round.established.is_empty() {
        true => "no effect".to_owned(),
        false => names(&round.established),
    };
    let open: Vec<Named> = [&round.supported, &round.alternatives]
        .into_iter()
        .flatten()
        .cloned()
        .collect();
    match open.is_empty() {
        true => found,
        false => format!("{found}; open: {}", names(&open)),
    }
}

fn headline(found: &Investigated) -> String {
    let last = found.rounds.last().expect("there is a run");
    let end = match found.ended {
        Ended::Settled => "nothing is open",
        Ended::NothingTells => "nothing within the limits would tell more",
        Ended::OutOfMotion => "the motion is used up",
    };
    format!(
        "found {} after {:.0} s of motion; {end}",
        answer(last),
        last.motion_s
    )
}

fn text(found: &Investigated, model: &Model, arguments: &Arguments) -> String {
    let mut out = headline(found) + "\n\n" + &table(&found.rounds);
    out += &region(&found.region, model);
    let _ = writeln!(
        out,
        "\n{}",
        arguments.out.join(REPORT).join("report.html").display()
    );
    out
}

/// The runs, in Markdown.
fn table(rounds: &[Round]) -> String {
    let mut out = String::from(
        "| run | motion | for | found | error on the new run | after |\n|---|---|---|---|---|---|\n",
    );
    for round in rounds {
        let unseen = round
            .unseen_rms
            .map_or_else(String::new, |rms| format!("{rms:.2e}"));
        let _ = writeln!(
            out,
            "| {} | {:.0} s | {} | {} | {unseen} | {:.2e} |",
            round.run,
            round.motion_s,
            purpose(&round.purpose),
            answer(round),
            round.rms
        );
    }
    out + "\nErrors are root mean squares of the open-loop error over half a second, in rad (m of joints that slide).\n"
}

/// Where the model was tested, in Markdown.
fn region(region: &Region, model: &Model) -> String {
    let mut out = String::from(
        "\nThe model was tested in this region, and nothing is known of it outside:\n\n| joint | position | speed | driven by |\n|---|---|---|---|\n",
    );
    for (joint, angle) in Joint::all(model.joints).zip(&region.angle) {
        let at = joint.index();
        let span = |[low, high]: Span, of: Quantity| {
            let text = format!("{low:.3} to {high:.3} {}", model.columns.unit(of, joint));
            text.trim_end().to_owned()
        };
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} |",
            model.joint_label(joint),
            span(*angle, Quantity::Angle),
            span(region.speed[at], Quantity::Velocity),
            span(region.driven[at], model.driven_by())
        );
    }
    out
}

fn value(found: &Investigated, config: &Value, seed: u64) -> Value {
    json!({
        "schema": 1,
        "version": env!("CARGO_PKG_VERSION"),
        "seed": seed,
        "ended": found.ended,
        "motion_s": found.rounds.last().map(|round| round.motion_s),
        "rounds": found.rounds,
        "region": found.region,
        "config": config,
    })
}

/// The report of closing the loop on all runs, the results, and a page of the whole.
fn write(
    arguments: &Arguments,
    folder: &RunFolder,
    model: &Model,
    found: &Investigated,
    value: &Value,
    call: &Call,
) -> Result<()> {
    let origin = Origin {
        config: value["config"].clone(),
        seed: arguments.common.seed,
        model_toml: model.declaration.clone(),
        call: Some(call.clone()),
    };
    report::write(folder.path().join(REPORT), &found.outcome, &origin)?;
    folder.write(RESULTS, value)?;
    let what = format!("investigation of {}", model.name);
    ResultsPage {
        what: &what,
        headline: &headline(found),
        text: &(table(&found.rounds) + &region(&found.region, model)),
        shares: Vec::new(),
        figure: None,
        seed: Some(arguments.common.seed),
        configuration: &value["config"],
        call,
    }
    .write(folder)?;
    Ok(())
}
