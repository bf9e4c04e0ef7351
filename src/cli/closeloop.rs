mod calibrate;
mod robot;

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use rand_chacha::ChaCha8Rng;

use super::call::{Begun, files};
use super::{Answer, Common, inputs, interrupt, progress, remedy, terminal};
use residyn_core::closeloop::{
    Calibrator, ErrorModel, Outcome, Reference, Request, Settings, Split, Verdict, prepare, solve,
};
use residyn_core::data::{LeaveOut, Log};
use residyn_core::model::InputFile;
use residyn_core::model::{Library, Model, Origin};
use residyn_core::rng;
use residyn_io::runs::RunFolder;
use residyn_io::{logs_in, plant_from_text, read_logs, read_model};
use residyn_report as report;
use residyn_train::ResidualTrainer;

/// Find what a model lacks: fit it, trace the residual to effects, add them, refit, report before and after
///
/// Without arguments: a simulated demo rig whose logs carry an effect that its model does not declare.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  residyn closeloop --model models/pendulum.toml --train run1.csv run2.csv \\\n      --test run3.csv --leave-out run1.csv@4.2-5.0 --out report\n  residyn closeloop --model pendulum --train run1.csv --test run3.csv --against published.toml old/model.toml\n  residyn closeloop robot.urdf logs/ --kp 20 --kd 1\n  residyn closeloop --calibrate 20"
)]
pub(super) struct Arguments {
    #[command(flatten)]
    robot: robot::Arguments,
    /// Model file, or the name of a built-in system
    #[arg(long, requires = "train")]
    model: Option<PathBuf>,
    /// Logs to learn from: files, or folders of them
    #[arg(long, num_args = 1.., value_name = "LOG", requires = "model", group = "learned")]
    train: Vec<PathBuf>,
    /// Logs to test on; without them, the last logs or the end of each log are set apart
    #[arg(long, num_args = 1.., value_name = "LOG", requires = "learned")]
    test: Vec<PathBuf>,
    /// Other models of the same rig to score as they are, without a fit: files or names of built-in systems
    #[arg(long, num_args = 1.., value_name = "MODEL")]
    against: Vec<PathBuf>,
    /// Folder for report.html, report.md, report.json, model.toml, plots and checkpoint
    #[arg(long, default_value = "closeloop-report", value_name = "DIR")]
    out: PathBuf,
    /// Intervals to leave out, in the time of the log
    #[arg(long, num_args = 1.., value_name = "LOG@T0-T1")]
    leave_out: Vec<LeaveOut>,
    /// Afterwards repeat the search on this many simulations of the accepted model: how often does it name an effect
    /// that is absent, and how small an effect would it name? Takes about as long as that many runs; the same command
    /// resumes an interrupted calibration
    #[arg(long, num_args = 0..=1, default_missing_value = "20", value_name = "RUNS", value_parser = inputs::count)]
    calibrate: Option<NonZeroUsize>,
    /// Time after which the search for effects stops as it stands, and the report says so: 90s, 10min, 2h
    #[arg(long, value_name = "TIME", default_value = "10min", value_parser = humantime::parse_duration)]
    budget: Duration,
    /// Which errors to compare: of the open-loop motion, or of the torques that the logged motion needs. Without it,
    /// whichever say more about these logs
    #[arg(long, value_enum)]
    errors: Option<Errors>,
    /// Horizons of the errors in s; models are fitted over windows of the middle one, and compared there. Without it
    /// 0.1, 0.5 and 1 s or, for the free motion of a joint without a drive, up to several swings
    #[arg(long, num_args = 1.., value_name = "S", value_parser = inputs::horizon)]
    horizon: Vec<f64>,
    /// Draw curves of the error below the answer, as is done on a terminal that shows UTF-8
    #[arg(long)]
    curves: bool,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

/// What `--errors` names.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Errors {
    Motion,
    Torque,
}

impl From<Errors> for ErrorModel {
    fn from(errors: Errors) -> Self {
        match errors {
            Errors::Motion => Self::OutputError,
            Errors::Torque => Self::InverseDynamics,
        }
    }
}

/// With more free parameters than this, a fit takes minutes.
const MANY_PARAMETERS: usize = 150;

/// The demo rig: its plant file is embedded, so that the program needs nothing but itself.
const DEMO: &str = include_str!("../../configs/demo.toml");

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let begun = Begun::now();
    let library = arguments.effects.library()?;
    let mut rng = rng(arguments.common.seed);
    let logs = Logs::of(arguments)?;
    let model = arguments.model.as_deref();
    let rig = robot::Declared::of(&arguments.robot, model, &arguments.out, &library)?;
    let (declared, split) = match &rig {
        Some(rig) => terminal::stage("reading the logs", || measured(arguments, rig, &logs))?,
        None => demo(&library, &mut rng)?,
    };
    let against = references(&arguments.against, &declared, &library)?;
    let inputs = input_files(arguments, &logs)?;
    if split.test.is_empty() {
        bail!("the logs are too short to set any of them apart for the test; give --test");
    }
    let folder = RunFolder::open(&arguments.out)?;
    let written = Arc::new(AtomicBool::new(false));
    let _orderly = interrupt::orderly(&folder, kept(&arguments.out, &written));
    let stages = progress::Stages::new(arguments.budget);
    let learner = ResidualTrainer {
        backend: arguments.common.device,
    };
    let mut request = Request::new(&declared, &library, split);
    request.against = against;
    request.learner = Some(&learner);
    request.error_model = arguments.errors.map(ErrorModel::from);
    request.horizons_s = Some(arguments.horizon.clone()).filter(|given| !given.is_empty());
    request.check_measured()?;
    let prepared = prepare(request, &stages);
    stages.beside(|| inputs::print_faults(prepared.audits()));
    let mut outcome = solve(&prepared, &mut rng, &stages)?;
    outcome.seconds = stages.finish();
    let origin = || Origin {
        call: Some(begun.call(&inputs)),
        ..origin(arguments, &logs, &declared)
    };
    let write = |outcome: &Outcome| {
        interrupt::whole(|| {
            let report = report::write(&arguments.out, outcome, &origin())?;
            rig.as_ref().map_or(Ok(()), robot::Declared::keep)?;
            written.store(true, Ordering::SeqCst);
            Ok::<_, anyhow::Error>(report)
        })
    };
    let mut report = terminal::stage("writing the report", || write(&outcome))?;
    if let Some(runs) = arguments.calibrate {
        // The report is safe before the long work begins.
        let problem = outcome.problem(&declared, &library);
        let accepted = &outcome.models.after;
        let calibrator = Calibrator::new(&problem, accepted, runs.get(), &mut rng)?;
        let run = calibrate::run_id(&origin(), &accepted.model, &inputs)?;
        let (calibration, kept) = calibrate::carry_out(calibrator, &folder, &run)?;
        outcome.calibration = Some(calibration);
        report = write(&outcome)?;
        kept.remove()?;
    }
    if arguments.common.json {
        terminal::json(&report)?;
    } else {
        let curves = match arguments.curves || terminal::shows_curves() {
            true => report::curves(&report),
            false => Vec::new(),
        };
        let words = report::Words {
            remedy: &remedy::of_finding,
            predict: &remedy::prediction,
        };
        let summary = report::summary(&report, &outcome.seconds, &arguments.out, &curves, &words);
        terminal::answer(report::answer(&report), &summary)?;
    }
    Ok(answer(&outcome))
}

/// What Ctrl-C leaves.
fn kept(out: &Path, written: &Arc<AtomicBool>) -> impl Fn() -> String + Send + 'static {
    let (out, written) = (out.display().to_string(), Arc::clone(written));
    move || match written.load(Ordering::SeqCst) {
        false => "nothing was written".to_owned(),
        true => format!("{out} has the report as last written"),
    }
}

/// The logs of a call, those of folders by their own names.
struct Logs {
    train: Vec<PathBuf>,
    test: Vec<PathBuf>,
}

impl Logs {
    fn of(arguments: &Arguments) -> Result<Self> {
        Ok(Self {
            train: logs_in(arguments.train.iter().chain(&arguments.robot.logs))?,
            test: logs_in(&arguments.test)?,
        })
    }
}

fn measured(arguments: &Arguments, rig: &robot::Declared, logs: &Logs) -> Result<(Model, Split)> {
    let (model, declared) = (&rig.path, rig.model.clone());
    inputs::print_findings(model, &declared, arguments.common.seed);
    if declared.free_parameters() > MANY_PARAMETERS {
        terminal::say(format!(
            "note: {}: {} free parameters are fitted at once; the time of a fit grows with the cube of their number; \
             set `fixed = true` for those that are known",
            model.display(),
            declared.free_parameters()
        ));
    }
    let mut train = read_logs(&logs.train, &declared)?;
    let mut test = read_logs(&logs.test, &declared)?;
    inputs::leave_out(&mut train, &mut test, &arguments.leave_out)?;
    let logs = || train.iter().chain(&test);
    let declared = inputs::with_values_of(&declared, logs())?;
    inputs::print_notes(logs());
    for log in logs().filter(|log| log.is_long()) {
        terminal::say(format!(
            "note: {}: only a part of its {} rows is fitted; see the report",
            log.name(),
            log.rows()
        ));
    }
    let split = if test.is_empty() {
        Split::of(train, &Settings::default().split)
    } else {
        Split::given(train, test)
    };
    Ok((declared, split))
}

fn demo(library: &Library, rng: &mut ChaCha8Rng) -> Result<(Model, Split)> {
    let plant = plant_from_text(Path::new("configs/demo.toml"), DEMO, library)?;
    let record = |k: usize| -> Result<Log> {
        let mut log = plant.record(rng)?;
        log.path = format!("demo{}.csv", k + 1).into();
        Ok(log)
    };
    let logs = (0..plant.recording.logs)
        .map(record)
        .collect::<Result<Vec<_>>>()?;
    // The loop gets only the declared model and the logs: the plant keeps the effects that it hides.
    Ok((
        plant.declared(),
        Split::of(logs, &Settings::default().split),
    ))
}

/// Models that predict the same joints, in the same units.
fn references(paths: &[PathBuf], declared: &Model, library: &Library) -> Result<Vec<Reference>> {
    let reference = |path: &PathBuf| {
        let other = read_model(path, library)?;
        if other.prismatic != declared.prismatic {
            bail!(
                "--against {}: it has {}, {} has {}; give models of the same rig",
                path.display(),
                joints(&other),
                declared.name,
                joints(declared)
            );
        }
        Ok(Reference {
            name: path.display().to_string(),
            model: other,
        })
    };
    paths.iter().map(reference).collect()
}

/// `2 joint(s) (slide, turn)`
fn joints(model: &Model) -> String {
    let kind = |slides: &bool| if *slides { "slide" } else { "turn" };
    let kinds: Vec<&str> = model.prismatic.iter().map(kind).collect();
    format!("{} joint(s) ({})", model.joints, kinds.join(", "))
}

/// The files that the run reads.
fn input_files(arguments: &Arguments, logs: &Logs) -> Result<Vec<InputFile>> {
    let effects = arguments.effects.files()?;
    let roles = [
        ("model", arguments.model.as_slice()),
        ("robot", arguments.robot.robot.as_slice()),
        ("train", &logs.train),
        ("test", &logs.test),
        ("against", &arguments.against),
        ("effect", &effects),
    ];
    let of_roles = roles.iter().map(|(role, paths)| files(role, paths));
    Ok(of_roles.collect::<Result<Vec<_>>>()?.concat())
}

fn origin(arguments: &Arguments, logs: &Logs, declared: &Model) -> Origin {
    let paths = |paths: &[PathBuf]| -> Vec<String> {
        let paths = paths.iter();
        paths.map(|path| path.display().to_string()).collect()
    };
    let spans = arguments
        .leave_out
        .iter()
        .map(|l| format!("{}@{}-{}", l.log, l.interval.start_s, l.interval.end_s));
    Origin {
        config: serde_json::json!({
            "command": "closeloop",
            "model": arguments.model.as_ref().map(|p| p.display().to_string()),
            "robot": arguments.robot.as_json(),
            "train": paths(&logs.train),
            "test": paths(&logs.test),
            "against": paths(&arguments.against),
            "leave_out": spans.collect::<Vec<_>>(),
            "effects": paths(&arguments.effects.folders),
            "calibrate": arguments.calibrate,
            "errors": arguments.errors.map(ErrorModel::from),
            "budget": humantime::format_duration(arguments.budget).to_string(),
            "device": arguments.common.device.name(),
        }),
        seed: arguments.common.seed,
        model_toml: declared.declaration.clone(),
        call: None,
    }
}

/// "No" if something is missing that could not be named, or if no verdict is possible.
fn answer(outcome: &Outcome) -> Answer {
    match outcome.verdict {
        Verdict::Explained | Verdict::PartlyExplained | Verdict::NoMissingEffect => Answer::Yes,
        Verdict::Unexplained | Verdict::Inconclusive => Answer::No,
    }
}
