use std::fmt::Write;

use super::accuracy::{contradicted, errors, parameters};
use super::calibration::section;
use super::remainder::remainder;
use super::wording::{capitalised, listed, probability, reduction, values};
use crate::closeloop::{Finding, Outcome, SplitMethod, Verdict};
use crate::data::{Audit, Severity};

/// The report in Markdown: the answer first, then the evidence, then what to be careful about.
pub fn text(outcome: &Outcome, seed: u64) -> String {
    let sections = [
        answer(outcome),
        effects(&outcome.effects.findings),
        confirmed(outcome),
        errors(outcome),
        parameters(outcome),
        contradicted(outcome),
        alternatives(outcome),
        remainder(outcome),
        tried(outcome),
        outcome
            .calibration
            .as_ref()
            .map_or_else(String::new, section),
        logs(outcome),
        footer(outcome, seed),
    ];
    sections.concat()
}

fn answer(outcome: &Outcome) -> String {
    format!(
        "# {}: {}\n\n{}{}.\n\n",
        outcome.models.after.model.name,
        headline(outcome),
        serious(outcome),
        capitalised(&outcome.reason)
    )
}

/// What makes results wrong unless something is done about it, as a list to stand above them.
pub(super) fn serious(outcome: &Outcome) -> String {
    let of_log = |audit: &Audit| -> Vec<String> {
        let line = |finding| format!("- **{}**: {finding}\n", audit.log);
        audit.serious().map(line).collect()
    };
    let lines: Vec<String> = outcome.given.audits.iter().flat_map(of_log).collect();
    if lines.is_empty() {
        return String::new();
    }
    format!(
        "Serious findings about the logs, to be mended first:\n\n{}\n",
        lines.concat()
    )
}

pub(super) fn headline(outcome: &Outcome) -> String {
    let found: Vec<String> = outcome
        .effects
        .findings
        .iter()
        .map(|f| format!("**{}** on joint {}", f.effect.title(), f.effect.joint))
        .collect();
    match (outcome.verdict, found.is_empty()) {
        (Verdict::Inconclusive, _) => "The logs do not allow a verdict".to_owned(),
        (_, false) => format!("The model lacks {}", listed(&found)),
        (Verdict::Unexplained, true) => {
            "Something is missing that no known effect explains".to_owned()
        }
        (_, true) => "These logs show no missing effect".to_owned(),
    }
}

fn effects(findings: &[Finding]) -> String {
    if findings.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "## Effects\n\n| effect | joint | adds | value (95 % interval) | p | error reduction |\n|---|---|---|---|---|---|\n",
    );
    for finding in findings {
        let values = values(finding);
        let _ = writeln!(
            out,
            "| {} | {} | `{}` | {} | {} | {} |",
            finding.effect.title(),
            finding.effect.joint,
            finding.expression,
            values.join("<br>"),
            probability(finding.p_value),
            match &finding.error_reduction {
                Ok(part) => reduction(*part, "error"),
                Err(error) => format!("not computed (refit without it: {error})"),
            }
        );
    }
    out + "\nError reduction: by how much the position error on the test logs, at the middle horizon, is below that of a refit without this effect.\n\n"
}

fn alternatives(outcome: &Outcome) -> String {
    if outcome.effects.alternatives.is_empty() {
        return String::new();
    }
    let mut out = String::from("## Other explanations that these logs do not rule out\n\n");
    for alternative in &outcome.effects.alternatives {
        let _ = writeln!(
            out,
            "- **{}** on joint {}: {}. To tell them apart: {}.",
            alternative.effect.title(),
            alternative.effect.joint,
            alternative.reason,
            alternative.experiment()
        );
    }
    out + "\n"
}

fn confirmed(outcome: &Outcome) -> String {
    let mut out = match (
        outcome.effects.findings.is_empty(),
        outcome.effects.confirmed_on,
    ) {
        (true, _) => String::new(),
        (false, 0) => {
            "The logs are too short to confirm the effects on data that did not select them.\n"
                .into()
        }
        (false, stretches) => format!(
            "Each effect also lowers the loss on {stretches} stretches of training data that did not select it.\n"
        ),
    };
    for withdrawn in &outcome.effects.withdrawn {
        let (label, reason) = (withdrawn.effect.label(), &withdrawn.reason);
        let _ = writeln!(
            out,
            "- **{label}** was selected and then withdrawn: {reason}."
        );
    }
    if out.is_empty() { out } else { out + "\n" }
}

fn tried(outcome: &Outcome) -> String {
    let mut out = String::from(
        "## What was tried\n\nGain: relative fall of the loss on stretches held out of the fit.\n\n",
    );
    let most_effects = outcome.given.settings.select.most_effects;
    for (number, round) in outcome.effects.rounds.iter().enumerate() {
        let _ = writeln!(
            out,
            "Round {} ({} candidates; the most promising were fitted):\n\n| effect | joint | gain | p | |\n|---|---|---|---|---|",
            number + 1,
            round.candidates
        );
        for (i, evidence) in round.evidence.iter().enumerate() {
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} | {} |",
                evidence.effect.title(),
                evidence.effect.joint,
                reduction(evidence.gain, "loss"),
                probability(evidence.p_value),
                if round.chosen == Some(i) { "added" } else { "" }
            );
        }
        out.push('\n');
    }
    if outcome.effects.rounds.len() == most_effects
        && outcome
            .effects
            .rounds
            .last()
            .is_some_and(|r| r.chosen.is_some())
    {
        let _ = writeln!(
            out,
            "The search stopped at its limit of {most_effects} effects; there may be more.\n"
        );
    }
    out
}

fn logs(outcome: &Outcome) -> String {
    let how = match &outcome.given.split {
        SplitMethod::Given => "as given".to_owned(),
        SplitMethod::LastLogs { count } => {
            format!("the last {count} logs were kept for the test")
        }
        SplitMethod::EndOfEachLog { share, gap_s } => {
            format!(
                "the last {:.0} % of each log, after a gap of {gap_s} s, were kept for the test",
                100.0 * share
            )
        }
    };
    let mut out = format!("## Logs\n\nSplit: {how}.\n\n");
    let roles = outcome
        .given
        .train
        .iter()
        .map(|_| "fitted")
        .chain(outcome.given.test.iter().map(|_| "test"));
    let all = outcome.given.train.iter().chain(&outcome.given.test);
    for ((log, audit), role) in all.zip(&outcome.given.audits).zip(roles) {
        let _ = writeln!(
            out,
            "- **{}** ({role}): {} rows, {:.2} s",
            log.name(),
            log.rows(),
            log.duration()
        );
        for span in &log.leave_out {
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

fn footer(outcome: &Outcome, seed: u64) -> String {
    let widths: Vec<String> = outcome
        .models
        .after
        .model
        .sign_widths()
        .iter()
        .map(|w| format!("{w:.3}"))
        .collect();
    format!(
        "---\nresidyn {}, seed {seed}. In fits and predictions the sign of a velocity is smoothed over {} rad/s (or m/s); \
         integrator: Runge-Kutta 4, steps of {:.2} ms.\n",
        env!("CARGO_PKG_VERSION"),
        widths.join(", "),
        1e3 * outcome.errors.after.step_s
    )
}
