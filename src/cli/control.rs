use std::fmt::Write;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use clap::Args;
use serde::Serialize;

use super::elsewhere::Elsewhere;
use super::inputs::{self, Source};
use super::{Answer, Common, interrupt, progress, terminal};
use residyn_control::control::{
    Controller, Episode, Policy, Predictor, Task, episode, with_controller,
};
use residyn_control::plan::Method;
use residyn_core::data::statistics::{mean, sample_deviation};
use residyn_core::data::{Joint, Log};
use residyn_core::model::{Library, Model};
use residyn_core::plant::Noise;
use residyn_core::streams::{Purpose, stream};
use residyn_io::files::write_whole;
use residyn_io::read_model;
use residyn_io::runs::RunFolder;
use residyn_io::write_log;
use residyn_plants::{Beginning, Controlled, plant_seed};
use residyn_plot::{JointKind, Panel, PlotError, Role, Track, predictions};
use residyn_train::Checkpoint;

/// Control a plant by model-predictive control with any model
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  residyn control --model pendulum --plant pendulum-real --episodes 3 --out episodes\n  \
                  residyn control --checkpoint checkpoints/pendulum-sim --plant pendulum-sim\n  \
                  residyn control --model pendulum --plant exec:\"python -m residyn.plants.mujoco rig.xml --step 0.05\""
)]
pub(super) struct Arguments {
    #[command(flatten)]
    model: inputs::ModelArguments,
    /// Plant file, model file, or the name of a built-in plant or system; or a plant in another process, exec:COMMAND or
    /// tcp:HOST:PORT
    #[arg(long, value_name = "NAME")]
    plant: PathBuf,
    #[command(flatten)]
    elsewhere: Elsewhere,
    /// Task file, or the name of a built-in task; by default a built-in one of the plant's system
    #[arg(long, value_name = "FILE")]
    task: Option<PathBuf>,
    #[arg(long, default_value = "1", value_parser = inputs::count)]
    episodes: NonZeroUsize,
    /// Steps of a plan that are executed before the next plan, instead of the task's
    #[arg(long, value_name = "STEPS")]
    replan: Option<usize>,
    /// Planner, instead of the task's; with that planner's default settings
    #[arg(long, value_name = "METHOD", value_parser = Method::names())]
    method: Option<String>,
    /// Positions, then velocities at the start, instead of the task's
    #[arg(long, num_args = 1.., value_name = "NUMBER", allow_negative_numbers = true)]
    start: Option<Vec<f64>>,
    /// Largest torque of each joint in N m, instead of the task's bounds
    #[arg(long, num_args = 1.., value_name = "NUMBER")]
    torque: Option<Vec<f64>>,
    /// Standard deviations of the sensors' noise: position and velocity
    #[arg(long, num_args = 2, value_name = "NUMBER")]
    noise: Option<Vec<f64>>,
    /// Folder for each episode as a log and as a plot of its positions (SVG)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Printed {
    schema: u32,
    version: &'static str,
    seed: u64,
    plant: PathBuf,
    task_name: String,
    /// As resolved.
    task: Task,
    episodes: Vec<Entry>,
    return_mean: f64,
    /// Over episodes; 0 for a single one.
    return_std: f64,
    /// Episodes in which the goal held until the end.
    successes: usize,
}

#[derive(Serialize)]
struct Entry {
    #[serde(rename = "return")]
    total: f64,
    success: bool,
    decisions: usize,
    ms_per_decision: f64,
    /// Candidates of all plans whose rollout diverged.
    diverged: usize,
    /// When plans were made whose candidates all diverged, in s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lost_s: Vec<f64>,
    /// Of a plant on the wall clock.
    #[serde(flatten)]
    late: Option<Late>,
    /// With an output folder.
    #[serde(flatten)]
    files: Option<Files>,
}

/// How late the commands of an episode came.
#[derive(Serialize)]
struct Late {
    /// Periods that passed before a command was ready.
    late: usize,
    /// From a row to the beginning of the command that answers it, as a rule.
    latency_s: f64,
}

#[derive(Serialize)]
struct Files {
    log: PathBuf,
    plot: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let library = arguments.effects.library()?;
    let planned = Planned::read(arguments, &library)?;
    let plant = arguments.elsewhere.open(&arguments.plant, &library)?;
    let task = task(arguments, &planned.system, &plant)?;
    let predictor = planned.predictor(&task);
    let folder = arguments.out.as_deref().map(RunFolder::open).transpose()?;
    if let Some(out) = &arguments.out {
        std::fs::create_dir_all(out)
            .with_context(|| format!("{} cannot be made", out.display()))?;
    }
    // The end of this program is the end of the plant's input, at which it holds its safe command.
    let _orderly = folder.as_ref().map(|folder| {
        let path = folder.path().display().to_string();
        interrupt::orderly(folder, move || format!("{path} keeps the episodes so far"))
    });
    let count = arguments.episodes.get();
    let begun = Instant::now();
    let bar = progress::bar(count);
    let mut entries = Vec::new();
    for number in 0..count {
        entries.push(one(arguments, &plant, &task, &predictor, number)?);
        bar.inc(1);
        bar.set_message("episodes");
    }
    bar.finish_and_clear();
    terminal::took("controlling the plant", begun);
    let printed = Printed::new(arguments, task, entries);
    let Printed {
        return_mean,
        successes,
        ..
    } = printed;
    let headline = format!("return {return_mean:.2}; {successes} of {count} episode(s) succeed");
    (arguments.common).answer(|| &printed, headline, &table(&printed))?;
    Ok(Answer::of(!lost_message(&printed.episodes)))
}

/// Say in which episode a plan first had no candidate with a finite return; returns whether there is such a plan.
fn lost_message(episodes: &[Entry]) -> bool {
    let firsts = episodes.iter().enumerate();
    let mut firsts = firsts.filter_map(|(number, e)| Some((number, e.lost_s.first()?)));
    let Some((number, first_s)) = firsts.next() else {
        return false;
    };
    let lost: usize = episodes.iter().map(|e| e.lost_s.len()).sum();
    let plans: usize = episodes.iter().map(|e| e.decisions).sum();
    terminal::tell(format!(
        "warning: {lost} of {plans} plan(s) failed, the first in episode {number} at {first_s:.3} s: no candidate has \
         a finite return, and the plant held its safe command; fix the model or the objective of the task, or shorten the \
         planner's horizon"
    ));
    true
}

/// The task, with the settings of the command line.
fn task(arguments: &Arguments, planned: &Model, plant: &Controlled) -> Result<Task> {
    let given = arguments.task.as_deref();
    let mut task = match plant {
        Controlled::Simulated(simulation) => Task::for_plant(&simulation.plant, given)?,
        Controlled::Elsewhere(_) => Task::for_system(&planned.name, planned.joints, given)?,
    };
    let Arguments {
        replan,
        method,
        start,
        torque,
        noise,
        ..
    } = arguments;
    if let Some(replan) = replan {
        task.replan = *replan;
    }
    if let Some(method) = method {
        let usual = Method::usual(method, task.planner.population);
        task.planner.method = usual.expect("clap knows the names");
    }
    if let Some(start) = start {
        task.start.clone_from(start);
    }
    if let Some(torque) = torque {
        task.torque = torque.iter().map(|most| [-most, *most]).collect();
    }
    if let Some([position, velocity]) = noise.as_deref() {
        task.plant.noise = Noise {
            position: *position,
            velocity: *velocity,
        };
    }
    plant.bound(&mut task, planned)?;
    task.check_for(plant.joints())?;
    Ok(task)
}

/// What the plans are made with.
struct Planned {
    system: Model,
    /// Of a checkpoint; a model file is planned with by the task's integrator.
    trained: Option<Predictor>,
}

impl Planned {
    fn read(arguments: &Arguments, library: &Library) -> Result<Self> {
        Ok(match arguments.model.source() {
            Source::Checkpoint(dir) => {
                let device = arguments.common.device;
                let (checkpoint, system, model) = Checkpoint::open(dir, library, device)?;
                let integrator = checkpoint.manifest.settings.integrator;
                let trained = Some(model.predictor(integrator));
                Self { system, trained }
            }
            Source::File(file) => {
                let system = read_model(file, library)?;
                system.runs_without_logs("a planner")?;
                let trained = None;
                Self { system, trained }
            }
        })
    }

    fn predictor(self, task: &Task) -> Predictor {
        let of_equations = || Predictor::of_equations(self.system.dynamics(), task.integrator);
        self.trained.unwrap_or_else(of_equations)
    }
}

fn one(
    arguments: &Arguments,
    plant: &Controlled,
    task: &Task,
    predictor: &Predictor,
    number: usize,
) -> Result<Entry> {
    let seed = arguments.common.seed;
    let mut noise = stream(seed, Purpose::Judge(number));
    let start = task.draw_start(&mut noise);
    let log = (arguments.out.as_deref()).map(|out| out.join(format!("episode-{number:03}.csv")));
    let draws = stream(seed, Purpose::JudgePlan(number));
    let predictor = &predictor.clone().acting_after(plant.latency());
    let beginning = Beginning {
        task,
        start: &start,
        seed: plant_seed(&noise),
        noise,
        log: log.as_deref(),
    };
    with_controller(predictor, task, task.replan, &draws, |controller| {
        let mut timed = Timed {
            controller,
            deciding: Duration::ZERO,
        };
        let episode = plant.during(beginning, |plant| episode(task, plant, &mut timed))?;
        let Timed {
            controller,
            deciding,
        } = timed;
        let decisions = controller.decisions();
        let late = plant.lateness().map(|lateness| Late {
            late: lateness.late,
            latency_s: lateness.latency() as f64 * task.step_s,
        });
        let files = match &log {
            Some(log) => Some(written(plant, task, &episode, log.clone())?),
            None => None,
        };
        Ok(Entry {
            total: episode.total(),
            success: episode.success,
            decisions,
            ms_per_decision: 1e3 * deciding.as_secs_f64() / decisions as f64,
            diverged: controller.diverged(),
            lost_s: controller.lost().to_vec(),
            late,
            files,
        })
    })
}

/// Write an episode and its plot; a plant in another process has written its log already.
fn written(plant: &Controlled, task: &Task, episode: &Episode, log: PathBuf) -> Result<Files> {
    if matches!(plant, Controlled::Simulated(_)) {
        write_log(&episode.stretch.log, &log)?;
    }
    let plot = log.with_extension("svg");
    let title = format!(
        "{} on {}: return {:.1}",
        task.name(),
        plant.name(),
        episode.total()
    );
    write_whole(
        &plot,
        positions(plant, &episode.stretch.log, &title)?.as_bytes(),
    )?;
    Ok(Files { log, plot })
}

/// The joints' positions over time, as SVG text.
fn positions(plant: &Controlled, log: &Log, title: &str) -> Result<String, PlotError> {
    let points = |joint: Joint| log.time.iter().copied().zip(log.q[joint].iter().copied());
    let panel = |joint: Joint| Panel {
        label: plant.joint_label(joint),
        quantity: JointKind::of(plant.slides(joint)).position(joint),
        tracks: vec![Track {
            label: "measured".to_owned(),
            role: Role::Measured,
            segments: vec![points(joint).collect()],
        }],
    };
    let panels: Vec<Panel> = Joint::all(log.q.len()).map(panel).collect();
    predictions(&panels, title)
}

/// A controller that measures the time of its decisions.
struct Timed<'c, 'p, 'r> {
    controller: &'c mut Controller<'p, 'r>,
    deciding: Duration,
}

impl Policy for Timed<'_, '_, '_> {
    fn torque(&mut self, measured: &[f64], time_s: f64) -> Option<Vec<f64>> {
        let began = Instant::now();
        let torque = self.controller.torque(measured, time_s);
        self.deciding += began.elapsed();
        torque
    }

    fn ahead(&self) -> Vec<Vec<f64>> {
        self.controller.ahead()
    }

    fn held(&mut self, torques: &[Vec<f64>]) {
        self.controller.held(torques);
    }
}

impl Printed {
    fn new(arguments: &Arguments, task: Task, episodes: Vec<Entry>) -> Self {
        let returns: Vec<f64> = episodes.iter().map(|e| e.total).collect();
        Self {
            schema: 1,
            version: env!("CARGO_PKG_VERSION"),
            seed: arguments.common.seed,
            plant: arguments.plant.clone(),
            task_name: task.name(),
            task,
            return_mean: mean(&returns),
            return_std: sample_deviation(&returns),
            successes: episodes.iter().filter(|e| e.success).count(),
            episodes,
        }
    }
}

fn table(printed: &Printed) -> String {
    let mut out = String::from("episode      return  success  decisions  ms/decision  diverged\n");
    for (number, e) in printed.episodes.iter().enumerate() {
        let success = if e.success { "yes" } else { "no" };
        let _ = writeln!(
            out,
            "{number:>7}  {:>10.2}  {success:>7}  {:>9}  {:>11.2}  {:>8}",
            e.total, e.decisions, e.ms_per_decision, e.diverged
        );
    }
    let count = printed.episodes.len();
    if count > 1 {
        let _ = writeln!(
            out,
            "return {:.2}, standard deviation {:.2}; {} of {count} episodes succeed",
            printed.return_mean, printed.return_std, printed.successes
        );
    }
    for e in &printed.episodes {
        for file in e.files.iter().flat_map(|files| [&files.log, &files.plot]) {
            let _ = writeln!(out, "{}", file.display());
        }
    }
    out
}
