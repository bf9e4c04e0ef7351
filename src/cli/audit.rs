use std::io::stdin;
use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;

use super::{Answer, Common, excitation, inputs, remedy, terminal};
use residyn_core::data::{Audit, Columns, Log, Severity, audit_together, report_repeats};
use residyn_core::model::{Library, Model};
use residyn_io::{
    logs_in, read_log, read_log_from, read_model, read_standard_log, read_standard_log_from,
};

/// Audit logs: units, signs, sampling, noise, jumps, lags, excitation, what they cannot show, and how to fix them
#[derive(Debug, Args)]
#[command(
    after_help = "Exit status 1 if a finding is serious.\n\nExample:\n  residyn audit run1.csv run2.csv"
)]
pub(super) struct Arguments {
    /// Model file, or the name of a built-in system, for names and units of columns; without it, the standard ones are
    /// assumed
    #[arg(long)]
    model: Option<PathBuf>,
    /// Logs to audit, or folders of them; `-` for one from standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let model = (arguments.model.as_ref())
        .map(|model| read_model(model, &Library::built_in()))
        .transpose()?;
    let logs = terminal::stage("reading the logs", || read(arguments, model.as_ref()))?;
    let columns = (model.as_ref()).map_or_else(Columns::default, |model| model.columns.clone());
    inputs::print_notes(&logs);
    if let Some(model) = &model {
        inputs::with_values_of(model, &logs)?;
    }
    for pattern in model.iter().flat_map(|model| model.unmatched(&logs)) {
        terminal::say(format!(
            "note: [logs.{pattern:?}] of the model matches none of these logs"
        ));
    }
    let mut audits = audit_together(&logs, &columns);
    report_repeats(&logs, &mut audits);
    if arguments.common.json {
        terminal::json(&audits)?;
    } else {
        for audit in &audits {
            let text = audit.message(&|remedy| format!("paste: {}", remedy::of_finding(remedy)));
            terminal::answer(headline(audit), &format!("{text}\n"))?;
        }
        if let Some(model) = model.as_ref().filter(|_| !terminal::is_quiet()) {
            terminal::print(&excitation::text(model, &logs))?;
        }
    }
    let serious = audits.iter().any(|audit| audit.serious().next().is_some());
    Ok(Answer::of(!serious))
}

/// `run1.csv: 1 serious, 2 warning(s)`
fn headline(audit: &Audit) -> String {
    let count = |severity| {
        let findings = audit.findings.iter();
        findings
            .filter(|finding| finding.severity == severity)
            .count()
    };
    let [serious, warnings] = [Severity::Serious, Severity::Warning].map(count);
    format!("{}: {serious} serious, {warnings} warning(s)", audit.log)
}

/// The logs, read with the model's columns or else with the standard ones.
fn read(arguments: &Arguments, model: Option<&Model>) -> Result<Vec<Log>> {
    let paths = logs_in(&arguments.logs)?;
    let logs = paths.iter();
    let Some(model) = model else {
        let logs = logs.map(|path| match is_standard_input(path) {
            true => read_standard_log_from(stdin().lock(), "-"),
            false => read_standard_log(path),
        });
        return Ok(logs.collect::<Result<_, _>>()?);
    };
    let logs = logs.map(|path| match is_standard_input(path) {
        true => read_log_from(stdin().lock(), "-", model),
        false => read_log(path, model),
    });
    Ok(logs.collect::<Result<_, _>>()?)
}

fn is_standard_input(path: &Path) -> bool {
    path.as_os_str() == "-"
}
