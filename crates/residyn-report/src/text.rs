use std::fmt::Write;

use super::accuracy::{compared, contradicted, errors, parameters, torques};
use super::bodies::bodies;
use super::calibration::section;
use super::diagnostics::diagnostics;
use super::schema::{EffectEntry, LogEntry, Report};
use super::wording::{capitalised, probability, reduction, split, values};
use residyn_core::closeloop::ErrorModel;
use residyn_core::data::{Finding, Interval, Severity};
use residyn_core::model::Call;

/// The report in Markdown: the answer first, then the evidence, then what to be careful about.
pub fn text(report: &Report) -> String {
    let sections = [
        answer(report),
        effects(report),
        supported(report),
        torques(report),
        errors(report),
        parameters(report),
        bodies(report),
        contradicted(report),
        alternatives(report),
        diagnostics(report),
        tried(report),
        (report.calibration.as_ref()).map_or_else(String::new, section),
        logs(report),
        footer(report),
    ];
    sections.concat()
}

fn answer(report: &Report) -> String {
    format!(
        "# {}: {}\n\n{}{}. {}\n\n",
        report.system,
        report.headline,
        serious(report),
        capitalised(&report.reason),
        compared(report)
    )
}

/// Findings that make results wrong unless they are fixed, as a list above the results.
pub(super) fn serious(report: &Report) -> String {
    let line = |(log, finding): (&str, &Finding)| format!("- **{log}**: {finding}\n");
    let lines: Vec<String> = report.serious().map(line).collect();
    if lines.is_empty() {
        return String::new();
    }
    format!(
        "Serious findings about the logs, to be fixed first:\n\n{}\n",
        lines.concat()
    )
}

fn effects(report: &Report) -> String {
    if report.effects.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "## Effects\n\n| effect | joint | adds | value (95 % interval) | p | error reduction |\n|---|---|---|---|---|---|\n",
    );
    for effect in &report.effects {
        let _ = writeln!(
            out,
            "| {} | {} | `{}` | {} | {} | {} |",
            effect.title,
            effect.place,
            effect.expression,
            values(&effect.parameters).join("<br>"),
            probability(effect.p_value),
            removed(effect)
        );
    }
    let error = match report.compared {
        ErrorModel::OutputError => "position error on the test logs, at the middle horizon,",
        ErrorModel::InverseDynamics => "torque error on the test logs",
    };
    out + &format!(
        "\nError reduction: by how much the {error} is below that of a refit without this effect.\n\n"
    )
}

/// The share of the error on the test logs that an effect removes.
pub(super) fn removed(effect: &EffectEntry) -> String {
    match (effect.error_reduction, &effect.error_reduction_failure) {
        (Some(part), _) => reduction(part, "error"),
        (None, failure) => format!(
            "not computed (refit without it: {})",
            failure.as_deref().unwrap_or_default()
        ),
    }
}

fn alternatives(report: &Report) -> String {
    if report.alternatives.is_empty() {
        return String::new();
    }
    let mut out = String::from("## Other explanations that these logs do not rule out\n\n");
    for alternative in &report.alternatives {
        let _ = writeln!(
            out,
            "- **{}** on joint {}: {}. To distinguish them: {}.",
            alternative.title, alternative.place, alternative.reason, alternative.experiment
        );
    }
    out + "\n"
}

fn supported(report: &Report) -> String {
    if report.supported.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "## Supported effects\n\nThese lower the loss on blocks left out of the fit and are in the model, but do not \
         rely on their names.\n\n",
    );
    for effect in &report.supported {
        let _ = writeln!(
            out,
            "- **{}** on joint {}, {}: {}.",
            effect.title,
            effect.place,
            values(&effect.parameters).join(", "),
            effect.not_established.as_deref().unwrap_or_default()
        );
    }
    out + "\n"
}

fn tried(report: &Report) -> String {
    let mut out = String::from(
        "## What was tried\n\nGain: relative drop of the loss on blocks held out of the fit.\n\n",
    );
    let rounds = report.tried.iter().zip(&report.candidates);
    for (number, (round, candidates)) in (1..).zip(rounds) {
        if round.is_empty() {
            let _ = writeln!(
                out,
                "Round {number} ({candidates} candidates): no set came near the loss that the round began with.\n"
            );
            continue;
        }
        let _ = writeln!(
            out,
            "Round {number} ({candidates} candidates; the most promising sets were fitted):\n\n| effects | gain | |\n|---|---|---|"
        );
        for tried in round {
            let effects: Vec<&str> = tried.effects.iter().map(|e| e.label.as_str()).collect();
            let _ = writeln!(
                out,
                "| {} | {} | {} |",
                effects.join(", "),
                reduction(tried.gain, "loss"),
                if tried.chosen { "chosen" } else { "" }
            );
        }
        out.push('\n');
    }
    out
}

fn logs(report: &Report) -> String {
    let how = split(&report.logs.split);
    let mut out = format!("## Logs\n\nSplit: {how}.\n\n");
    let with_role = |logs: &'static str| move |log| (log, logs);
    let train = report.logs.train.iter().map(with_role("fitted"));
    let test = report.logs.test.iter().map(with_role("test"));
    let all: Vec<(&LogEntry, &str)> = train.chain(test).collect();
    for ((log, role), audit) in all.into_iter().zip(&report.audit) {
        let _ = writeln!(
            out,
            "- **{}** ({role}): {} rows, {:.2} s",
            log.name,
            log.rows,
            log.end_s - log.start_s
        );
        for &[start_s, end_s] in &log.leave_out {
            let span = Interval { start_s, end_s };
            let _ = writeln!(out, "  - left out: {span}");
        }
        for finding in audit
            .findings
            .iter()
            .filter(|f| f.severity != Severity::Info)
        {
            let _ = writeln!(out, "  - {finding}");
        }
    }
    out + "\n"
}

/// When, by which command and for how long.
fn called(call: &Call) -> String {
    let Call {
        command,
        began,
        took_s,
        ..
    } = call;
    format!("Started on {began} by `{command}`, took {took_s:.1} s. ")
}

fn footer(report: &Report) -> String {
    let widths: Vec<String> = report
        .smoothing_velocities
        .iter()
        .map(|w| format!("{w:.3}"))
        .collect();
    let call = report.call.as_ref().map_or_else(String::new, called);
    format!(
        "---\nresidyn {}, seed {}. {call}In fits and predictions the sign of a velocity is smoothed over {} rad/s (or m/s); \
         integrator: Runge-Kutta 4, steps of {:.2} ms.\n",
        report.version,
        report.seed,
        widths.join(", "),
        1e3 * report.error.integrator_step_s
    )
}
