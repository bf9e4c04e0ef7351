use std::fmt::Write;

use super::accuracy::{compared, contradicted, errors, parameters, torques};
use super::bodies::bodies;
use super::calibration::section;
use super::remainder::remainder;
use super::wording::{capitalised, listed, probability, reduction, values};
use crate::closeloop::{Outcome, Space, SplitMethod, Verdict};
use crate::data::{Audit, Joint, Severity};
use crate::model::FittedEffect;

/// The report in Markdown: the answer first, then the evidence, then what to be careful about.
pub fn text(outcome: &Outcome, seed: u64) -> String {
    let sections = [
        answer(outcome),
        effects(outcome),
        supported(outcome),
        torques(outcome),
        errors(outcome),
        parameters(outcome),
        bodies(outcome),
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
        "# {}: {}\n\n{}{}. {}\n\n",
        outcome.models.after.model.name,
        headline(outcome),
        serious(outcome),
        capitalised(&outcome.reason),
        compared(outcome)
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
    let mut titles: Vec<String> = Vec::new();
    let mut joints: Vec<Vec<String>> = Vec::new();
    for finding in &outcome.effects.findings {
        let (title, joint) = (finding.effect.title(), place(outcome, &finding.effect));
        match titles.iter().position(|known| *known == title) {
            Some(known) => joints[known].push(joint),
            None => {
                titles.push(title);
                joints.push(vec![joint]);
            }
        }
    }
    let found: Vec<String> = (titles.iter().zip(&joints))
        .map(|(title, joints)| {
            let plural = if joints.len() > 1 { "s" } else { "" };
            format!("**{title}** on joint{plural} {}", listed(joints))
        })
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

/// A joint for people.
pub(super) fn label(outcome: &Outcome, joint: Joint) -> String {
    outcome.models.after.model.joint_label(joint)
}

/// The joint of an effect, or both where it couples two.
pub(super) fn place(outcome: &Outcome, effect: &FittedEffect) -> String {
    effect.place(|joint| label(outcome, joint))
}

fn effects(outcome: &Outcome) -> String {
    let findings = &outcome.effects.findings;
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
            place(outcome, &finding.effect),
            finding.expression,
            values.join("<br>"),
            probability(finding.p_value),
            match &finding.error_reduction {
                Ok(part) => reduction(*part, "error"),
                Err(error) => format!("not computed (refit without it: {error})"),
            }
        );
    }
    let error = match outcome.space {
        Space::Motion => "position error on the test logs, at the middle horizon,",
        Space::Torque => "torque error on the test logs",
    };
    out + &format!(
        "\nError reduction: by how much the {error} is below that of a refit without this effect.\n\n"
    )
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
            place(outcome, &alternative.effect),
            alternative.reason,
            alternative.experiment()
        );
    }
    out + "\n"
}

fn supported(outcome: &Outcome) -> String {
    let supported = &outcome.effects.supported;
    if supported.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "## Supported effects\n\nThese lower the loss on stretches left out of the fit and are in the model, but their \
         names are not to be relied on.\n\n",
    );
    for finding in supported {
        let _ = writeln!(
            out,
            "- **{}** on joint {}, {}: {}.",
            finding.effect.title(),
            place(outcome, &finding.effect),
            values(finding).join(", "),
            finding.reason.as_deref().unwrap_or_default()
        );
    }
    out + "\n"
}

fn tried(outcome: &Outcome) -> String {
    let mut out = String::from(
        "## What was tried\n\nGain: relative fall of the loss on stretches held out of the fit.\n\n",
    );
    for (number, round) in outcome.effects.rounds.iter().enumerate() {
        let (number, candidates) = (number + 1, round.candidates);
        if round.tried.is_empty() {
            let _ = writeln!(
                out,
                "Round {number} ({candidates} candidates): no set came near the loss that the round began with.\n"
            );
            continue;
        }
        let _ = writeln!(
            out,
            "Round {number} ({candidates} candidates; the sets that promised most were fitted):\n\n| effects | gain | |\n|---|---|---|"
        );
        for tried in &round.tried {
            let effects: Vec<String> = tried.effects.iter().map(FittedEffect::label).collect();
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
