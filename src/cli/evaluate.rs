use std::fmt::Write;
use std::path::PathBuf;

use anyhow::{Result, anyhow, bail};
use clap::Args;
use serde::Serialize;

use super::inputs::{self, Source};
use super::status::NotFinite;
use super::{Answer, Common, terminal};
use residyn_core::data::{Joint, LeaveOut, Log, TorqueColumn, audit_together};
use residyn_core::identify::calibrate;
use residyn_core::model::{Dynamics, Model};
use residyn_core::sim::metric::{
    Summary, TorqueError, assess, summarise, torque_column, torque_error, torques_leave,
};
use residyn_io::{logs_in, read_logs, read_model};
use residyn_train::Checkpoint;

/// Open-loop prediction error of a model or a checkpoint on logs
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  residyn evaluate --model report/model.toml --test run3.csv --horizon 0.5 1.0"
)]
pub(super) struct Arguments {
    #[command(flatten)]
    model: inputs::ModelArguments,
    /// Logs to predict: files, or folders of them
    #[arg(long, num_args = 1.., required = true, value_name = "LOG")]
    test: Vec<PathBuf>,
    /// Horizons in s
    #[arg(long, num_args = 1.., default_values_t = [0.1, 0.5, 1.0], value_name = "S", value_parser = inputs::horizon)]
    horizon: Vec<f64>,
    /// Compare the torques that the logged motion needs with the logged ones as well
    #[arg(long, conflicts_with = "checkpoint")]
    torque: bool,
    /// Estimate each log's own sensor offsets on this fraction of it and score the rest
    #[arg(long, value_name = "F")]
    calibrate: Option<f64>,
    /// Intervals to leave out, in the time of the log
    #[arg(long, num_args = 1.., value_name = "LOG@T0-T1")]
    leave_out: Vec<LeaveOut>,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    common: Common,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Printed {
    #[serde(flatten)]
    summary: Summary,
    #[serde(skip_serializing_if = "Option::is_none")]
    torque: Option<TorqueError>,
    logs: Vec<LogEntry>,
    /// Estimated sensor offsets (rad or m), one list per log.
    #[serde(skip_serializing_if = "Option::is_none")]
    offsets: Option<Vec<Vec<f64>>>,
    integrator_step_s: f64,
    integrator_error: f64,
}

#[derive(Serialize)]
struct LogEntry {
    name: String,
    leave_out: Vec<[f64; 2]>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let (declared, trained) = model(arguments)?;
    let mut logs = terminal::stage("reading the logs", || {
        read_logs(logs_in(&arguments.test)?, &declared)
    })?;
    let declared = inputs::with_values_of(&declared, &logs)?;
    let dynamics = trained.unwrap_or_else(|| declared.dynamics());
    inputs::leave_out(&mut Vec::new(), &mut logs, &arguments.leave_out)?;
    if let Source::File(file) = arguments.model.source() {
        inputs::print_findings(file, &declared, arguments.common.seed);
    }
    inputs::print_notes(&logs);
    inputs::print_faults(&audit_together(&logs, &declared.columns));
    let steps = logs.iter().map(Log::median_step);
    let step_s = steps.fold(f64::INFINITY, f64::min);
    if let Some(short) = arguments.horizon.iter().find(|horizon| **horizon < step_s) {
        bail!(
            "--horizon {short:?}: the logs have a row every {step_s:.2e} s; give a longer horizon"
        );
    }
    let offsets = arguments
        .calibrate
        .map(|share| calibrate(&dynamics, &mut logs, share))
        .transpose()?;
    let dynamics = offsets.as_ref().map_or(&dynamics, |found| &found.dynamics);
    let assess = || assess(dynamics, &logs, &arguments.horizon);
    let assessment = terminal::stage("predicting", assess);
    let summary = summarise(&assessment.horizons, declared.joints);
    if let Some(h) = summary.windows.iter().position(|count| *count == 0) {
        bail!(
            "no window of {} s fits into the logs; give longer logs or a shorter --horizon",
            summary.horizons_s[h]
        );
    }
    let torque = arguments
        .torque
        .then(|| torque(&declared, &logs))
        .transpose()?;
    if arguments.common.json {
        let entry = |log: &Log| LogEntry {
            name: log.name(),
            leave_out: log
                .leave_out
                .iter()
                .map(|span| [span.start_s, span.end_s])
                .collect(),
        };
        let printed = Printed {
            summary,
            torque,
            logs: logs.iter().map(entry).collect(),
            offsets: offsets.map(|offsets| offsets.offsets),
            integrator_step_s: assessment.step_s,
            integrator_error: assessment.step_error,
        };
        terminal::json(&printed)?;
    } else {
        let torque = torque.as_ref().map_or_else(String::new, torques);
        terminal::answer(headline(&summary), &(table(&summary) + &torque))?;
    }
    Ok(Answer::Yes)
}

/// The declared model, for the columns of its logs, and the dynamics to integrate.
/// The model as its file declares it, and that of a checkpoint as it was trained.
fn model(arguments: &Arguments) -> Result<(Model, Option<Dynamics>)> {
    let library = arguments.effects.library()?;
    match arguments.model.source() {
        Source::File(file) => Ok((read_model(file, &library)?, None)),
        Source::Checkpoint(dir) => {
            let (_, declared, trained) = Checkpoint::open(dir, &library, arguments.common.device)?;
            let dynamics = trained.to_dynamics()?;
            Ok((declared, Some(dynamics)))
        }
    }
}

/// The error of the torques on logs.
fn torque(model: &Model, logs: &[Log]) -> Result<TorqueError> {
    if !model.has_mass_matrix() {
        bail!(
            "--torque: {} gives accelerations; state it as `mass` and `bias`, or as a chain",
            model.name
        );
    }
    let logs = &with_known_torques(model, logs);
    let error = torque_error(model, logs)
        .ok_or_else(|| anyhow!("--torque: no log is longer than a second; give a longer one"))?;
    if !error.rms.iter().all(|rms| rms.is_finite()) {
        let place = torques_leave(model, logs);
        let place = place.map_or_else(String::new, |(log, time_s)| {
            format!(", first in {log} at {time_s:.3} s")
        });
        bail!(NotFinite(format!(
            "--torque: the torques that {} needs, or their squares, are not finite{place}; `residyn check` shows what \
             is implausible in the model",
            model.name
        )));
    }
    Ok(error)
}

/// The logs with torques of the kind that the model file gives or, without one, that the torque error shows.
fn with_known_torques(model: &Model, logs: &[Log]) -> Vec<Log> {
    let mut logs = logs.to_vec();
    if model.columns.torque.is_none()
        && let Some(column) = torque_column(model, &logs)
        && column != TorqueColumn::Held
    {
        terminal::say(format!(
            "note: the torque error takes the logged torques as `[log] torque = \"{0}\"`, with which it is clearly \
             smaller than with held ones; put that into the model file for all other errors, or \"held\"",
            column.key()
        ));
        logs = logs
            .into_iter()
            .map(|log| log.with_torques(column))
            .collect();
    }
    logs
}

fn torques(error: &TorqueError) -> String {
    let mut out = String::from("\njoint  torque rms\n");
    for (joint, rms) in Joint::all(error.rms.len()).zip(&error.rms) {
        let _ = writeln!(out, "{joint:>5}  {rms:>10.5}");
    }
    let _ = writeln!(out, "relative to the torques that act: {}", error.share());
    out
}

/// `position error 0.5 s ahead, rms: 0.0183 on joint 1, 0.0308 on joint 2`
fn headline(summary: &Summary) -> String {
    let middle = summary.horizons_s.len() / 2;
    let errors = &summary.position_rmse[middle];
    let of_joint = |joint: Joint| format!("{:.4} on joint {joint}", errors[joint]);
    let errors: Vec<String> = Joint::all(errors.len()).map(of_joint).collect();
    format!(
        "position error {} s ahead, rms: {}",
        summary.horizons_s[middle],
        errors.join(", ")
    )
}

fn table(summary: &Summary) -> String {
    let mut out =
        String::from("horizon  joint  windows  position rmse    median  velocity rmse  diverged\n");
    for (h, horizon) in summary.horizons_s.iter().enumerate() {
        for joint in Joint::all(summary.position_rmse[h].len()) {
            let _ = writeln!(
                out,
                "{horizon:>5} s  {joint:>5}  {:>7}  {:>13.6}  {:>8.6}  {:>13.6}  {:>8}",
                summary.windows[h],
                summary.position_rmse[h][joint],
                summary.position_median[h][joint],
                summary.velocity_rmse[h][joint],
                summary.diverged[h]
            );
        }
    }
    out
}
