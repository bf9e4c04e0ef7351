//! How the report was made.

use maud::html;
use serde::Serialize;

use super::{Block, Cell, Section, cells, paragraph, table};
use crate::schema::{LogEntry, Report};
use crate::wording::split;
use residyn_core::data::Interval;
use residyn_core::model::{Call, InputFile};

pub(super) fn section(report: &Report) -> Section {
    let call = report.call.as_ref().map(called).unwrap_or_default();
    let widths = report.smoothing_velocities.iter();
    let widths: Vec<String> = widths.map(|width| format!("{width:.3}")).collect();
    let fixed = format!(
        "In fits and predictions the sign of a velocity is smoothed over {} rad/s (or m/s); integrator: Runge-Kutta 4, steps of \
         {:.2} ms.",
        widths.join(", "),
        1e3 * report.error.integrator_step_s
    );
    let train = report.logs.train.iter().map(|log| row(log, "fitted"));
    let test = report.logs.test.iter().map(|log| row(log, "test"));
    let heads = ["log", "role", "rows", "from, s", "to, s", "left out"];
    let own = vec![
        paragraph(format!("Test logs: {}.", split(&report.logs.split))),
        table(1, heads, train.chain(test)),
        paragraph(fixed),
        dump("Configuration as resolved", &report.configuration),
        dump("Every tuning constant", &report.settings),
    ];
    let program = program(&report.version, Some(report.seed));
    of([vec![program], call, own].concat())
}

/// As above, for an experiment or the bench.
pub(crate) fn of_call(call: &Call, seed: Option<u64>, configuration: &impl Serialize) -> Section {
    let program = program(env!("CARGO_PKG_VERSION"), seed);
    let configuration = dump("Configuration as resolved", configuration);
    of([vec![program], called(call), vec![configuration]].concat())
}

fn of(answer: Vec<Block>) -> Section {
    Section {
        id: "made",
        question: "How was it made?",
        answer,
    }
}

fn program(version: &str, seed: Option<u64>) -> Block {
    let seed = seed.map_or_else(String::new, |seed| format!(", seed {seed}"));
    paragraph(format!(
        "residyn {version}{seed}. The same seed gives the same result on the same machine."
    ))
}

/// The command, when it ran, and its files with their hashes.
fn called(call: &Call) -> Vec<Block> {
    let began = format!("Started on {}, took {:.1} s:", call.began, call.took_s);
    let row = |file: &InputFile| cells([&file.path, &file.role, &format!("`{}`", file.sha256)]);
    let files = table(
        1,
        ["file", "read as", "SHA-256"],
        call.inputs.iter().map(row),
    );
    let files = (!call.inputs.is_empty()).then_some(files);
    let ran = [paragraph(began), Block::Code(call.command.clone())];
    ran.into_iter().chain(files).collect()
}

fn row(log: &LogEntry, role: &str) -> Vec<Cell> {
    let spans = log.leave_out.iter();
    let spans = spans.map(|&[start_s, end_s]| Interval { start_s, end_s }.to_string());
    let spans: Vec<String> = spans.collect();
    cells([
        log.name.clone(),
        role.to_owned(),
        log.rows.to_string(),
        format!("{:.2}", log.start_s),
        format!("{:.2}", log.end_s),
        spans.join(", "),
    ])
}

/// Folded away on a page; readers of a text have report.json.
fn dump(what: &str, value: &impl Serialize) -> Block {
    let json = serde_json::to_string_pretty(value);
    let json = json.expect("a report has only finite numbers and texts");
    Block::Drawn {
        page: html! { details { summary { (what) } pre tabindex="0" { (json) } } },
        files: &[],
    }
}
