use std::fmt::Write;

use super::calibration::section;
use super::wording::{
    AS_WRITTEN, FITTED, WITH_EFFECTS, WITH_NETWORK, amount, capitalised, listed, probability,
    reduction, small, value, values,
};
use crate::closeloop::{Finding, Outcome, Proposal, ResidualForce, SplitMethod, UNKNOWN, Verdict};
use crate::data::{Joint, Severity};
use crate::identify::FitError;
use crate::sim::metric::{Summary, summarise};

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
        left(outcome),
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
        "# {}: {}\n\n{}.\n\n",
        outcome.models.after.name,
        headline(outcome),
        capitalised(&outcome.reason)
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

/// The unit of positions: that of all joints, or both.
fn position_unit(outcome: &Outcome) -> &'static str {
    let sliding = outcome
        .given
        .prismatic
        .iter()
        .filter(|slides| **slides)
        .count();
    match sliding {
        0 => "rad",
        all if all == outcome.given.prismatic.len() => "m",
        _ => "rad or m",
    }
}

/// Every model that was scored on the test logs, with its name in a table.
fn scored(outcome: &Outcome) -> Vec<(&str, Summary)> {
    let errors = &outcome.errors;
    let mut models = vec![
        (AS_WRITTEN, &errors.declared),
        (FITTED, &errors.before),
        (WITH_EFFECTS, &errors.after),
    ];
    let hybrid = errors.hybrid.iter();
    models.extend(hybrid.map(|m| (WITH_NETWORK, m)));
    models.extend(errors.against.iter().map(|(name, m)| (name.as_str(), m)));
    let joints = outcome.models.after.joints;
    models
        .into_iter()
        .map(|(name, model)| (name, summarise(&model.horizons, joints)))
        .collect()
}

fn errors(outcome: &Outcome) -> String {
    let models = scored(outcome);
    let names: Vec<&str> = models.iter().map(|(name, _)| *name).collect();
    let mut out = format!(
        "## Open-loop error on the test logs\n\nRoot mean square of the position error in {}; in brackets the median over \
         windows. \"Fitted\" is the declared model with its own parameters fitted to the training logs and no effect added: \
         the fair \"before\" of every comparison in this report.{}\n\n\
         | horizon | joint | windows | {} | with effects / fitted |\n|---|---|---|{}---|\n",
        position_unit(outcome),
        if outcome.errors.against.is_empty() {
            ""
        } else {
            " The last models are other files, scored as they are."
        },
        names.join(" | "),
        "---|".repeat(names.len())
    );
    let (before, after) = (&models[1].1, &models[2].1);
    for (h, horizon) in before.horizons_s.iter().enumerate() {
        for joint in Joint::all(outcome.models.after.joints) {
            let rmse = |s: &Summary| s.position_rmse[h][joint];
            let cell = |(_, s): &(&str, Summary)| {
                format!(
                    "{} ({})",
                    small(rmse(s)),
                    small(s.position_median[h][joint])
                )
            };
            let cells: Vec<String> = models.iter().map(cell).collect();
            let _ = writeln!(
                out,
                "| {horizon} s | {joint} | {} | {} | {:.2} |",
                before.windows[h],
                cells.join(" | "),
                rmse(after) / rmse(before).max(f64::MIN_POSITIVE)
            );
        }
    }
    for (name, model) in &models {
        let diverged: usize = model.diverged.iter().sum();
        if diverged > 0 {
            let _ = writeln!(
                out,
                "\n{name}: {diverged} windows diverged; each counts with the error reached by then."
            );
        }
    }
    if let Some([low, high]) = outcome.errors.reduction_ci95 {
        let _ = writeln!(
            out,
            "\nThe effects remove {:.0} to {:.0} % of the fitted declared model's error at {} s (95 % interval, bootstrap over parts of the test logs).",
            100.0 * low,
            100.0 * high,
            before.horizons_s[before.horizons_s.len() / 2]
        );
    }
    out + "\n![predictions](predictions.svg)\n\n![errors](errors.svg)\n\n"
}

fn parameters(outcome: &Outcome) -> String {
    let mut out = String::from("## Parameters of the declared equations\n\n");
    let after = outcome.models.after.absorbed();
    for (parameter, before) in after
        .parameters
        .iter()
        .zip(&outcome.models.before.parameters)
    {
        let _ = writeln!(
            out,
            "- {}; fitted without the effects: {:.5}",
            value(parameter),
            before.value
        );
    }
    let verdict = &outcome.models.identifiability;
    let _ = writeln!(
        out,
        "\nThe logs determine {} of {} free parameters.",
        verdict.determined, verdict.free
    );
    for (name, model) in [
        (FITTED, &outcome.models.before),
        (WITH_EFFECTS, &outcome.models.after),
    ] {
        let (steps, termination) = (model.fit.steps, model.fit.termination);
        let _ = writeln!(out, "- Fit ({name}): {termination} ({steps} steps).");
    }
    for &k in &verdict.hold {
        let name = &outcome.models.before.parameters[k].name;
        let _ = writeln!(
            out,
            "- `{name}` is held: the logs determine it only in combination with others. \
             Fitted values of the others, and of effects, are relative to it."
        );
    }
    out + "\n"
}

/// Which numbers of the model file do not hold for these logs.
fn contradicted(outcome: &Outcome) -> String {
    if outcome.models.contradicted.is_empty() {
        return String::new();
    }
    let errors = &outcome.errors;
    let (written, fitted) = (errors.declared.position_rms(), errors.before.position_rms());
    let mut out = format!(
        "## Declared values that these logs contradict\n\nOn the test logs, {} s ahead, the position error of the declared model \
         is {} {unit} with the values in its file and {} {unit} with its parameters fitted to the training logs. These declared \
         values lie outside the 95 % intervals of the final fit, which includes the effects found:\n\n",
        errors.before.middle().horizon_s,
        small(written),
        small(fitted),
        unit = position_unit(outcome),
    );
    for one in &outcome.models.contradicted {
        let _ = writeln!(
            out,
            "- {}: declared {}, fitted {}: {}",
            one.fitted.name,
            one.declared,
            amount(&one.fitted),
            one.comparison()
        );
    }
    out + "\nmodel.toml holds the fitted values. If a declared value comes from another log, check that log with `residyn audit`; \
           if it comes from a drawing, look for a wrong unit, gear ratio or torque constant.\n\n"
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
    for taken_back in &outcome.effects.taken_back {
        let (label, reason) = (taken_back.effect.label(), &taken_back.reason);
        let _ = writeln!(
            out,
            "- **{label}** was selected and then withdrawn: {reason}."
        );
    }
    if out.is_empty() { out } else { out + "\n" }
}

fn left(outcome: &Outcome) -> String {
    let left = &outcome.remainder.unexplained;
    let settings = &outcome.given.settings.remainder;
    let p = probability(left.p_value);
    let share = 100.0 * left.omnibus.most().1;
    let structure = match left.place.as_str() {
        UNKNOWN => format!(
            "The residuals are not white noise (p = {p}; {share:.0} % of their variance exceeds it), but they are no smooth \
             function of angle, speed, torque or time. Candidates are effects with a state or a frequency of their own: \
             joint compliance, presliding friction, a periodic disturbance."
        ),
        place if left.is_significant() => format!("The remainder depends on {place} (p = {p})."),
        _ if left.p_value < settings.significance => format!(
            "The remainder has structure (p = {p}), but too little to matter: {share:.1} % of the residuals' variance \
             exceeds white noise, and no probe lowers the loss by {:.0} %.",
            100.0 * settings.noteworthy
        ),
        _ => format!("The residuals cannot be told from sensor noise (p = {p})."),
    };
    let network = match &outcome.errors.hybrid {
        Some(hybrid) if hybrid.position_rms() > 1.01 * outcome.errors.after.position_rms() => {
            "The residual network raises the error on the test logs: use model.toml rather than the checkpoint.\n"
        }
        _ => "",
    };
    format!(
        "## What is left\n\nOf the residual variance above the sensor noise, {:.1} % is left. {structure}\n{network}\
         Residual generalised force: {} ({FITTED}) and {} ({WITH_EFFECTS}), root mean square over stretches of {} s in \
         N m or N.\n\n\
         ![residual](residual.svg)\n\n{}",
        100.0 * left.fraction,
        force(&outcome.remainder.before),
        force(&outcome.remainder.after),
        settings.stretch_s,
        outcome
            .remainder
            .proposal
            .as_ref()
            .map(proposed)
            .unwrap_or_default()
    )
}

fn force(force: &Result<ResidualForce, FitError>) -> String {
    match force {
        Ok(force) => format!("{:.4}", force.norm()),
        Err(error) => format!("not computed ({error})"),
    }
}

fn proposed(proposal: &Proposal) -> String {
    format!(
        "{}.\nSupported only by its fit. As an effect file, for a folder given with `--effects`:\n\n\
         ```toml\n{}```\n\n",
        capitalised(&proposal_line(proposal)),
        proposal.file
    )
}

/// `proposal, not a finding: force on joint 1 ~ -0.0012 * qd1^3 (explains 81 % of the remainder on held-out stretches)`
pub(super) fn proposal_line(proposal: &Proposal) -> String {
    format!(
        "proposal, not a finding: force on joint {} ~ {} (explains {:.0} % of the remainder on held-out stretches)",
        proposal.joint,
        proposal.formula,
        100.0 * proposal.explains
    )
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
            let _ = writeln!(out, "  - {}", finding.text);
        }
    }
    out + "\n"
}

fn footer(outcome: &Outcome, seed: u64) -> String {
    let widths: Vec<String> = outcome
        .models
        .after
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
