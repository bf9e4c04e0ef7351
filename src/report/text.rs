use std::fmt::Write;

use super::calibration::section;
use crate::closeloop::{
    Finding, MOST_EFFECTS, NOTEWORTHY, Outcome, Proposal, ResidualForce, SIGNIFICANT, SplitMethod,
    UNKNOWN, Verdict,
};
use crate::data::{Joint, Severity};
use crate::evaluate::{Summary, summarise};
use crate::identify::FitError;
use crate::model::{OwnValue, Parameter};

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
            "Something is missing that no known effect names".to_owned()
        }
        (_, true) => "Nothing is missing that these logs could show".to_owned(),
    }
}

/// `a`, `a and b`, `a, b and c`
pub(super) fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().collect::<String>() + letters.as_str()
    })
}

fn effects(findings: &[Finding]) -> String {
    if findings.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "## Effects\n\n| effect | joint | adds | value (95 % interval) | p | cuts the error by |\n|---|---|---|---|---|---|\n",
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
            share(finding.error_reduction)
        );
    }
    out + "\n\"Cuts the error by\" compares the position error on the test logs at the middle horizon with that of a refit without this effect.\n\n"
}

/// A share that something takes away, in words where it adds instead.
fn share(part: f64) -> String {
    let percent = 100.0 * part;
    if percent > -0.05 {
        format!("{:.1} %", percent.max(0.0))
    } else if percent > -100.0 {
        format!("nothing: raises it by {:.1} %", -percent)
    } else {
        "nothing: more than doubles it".to_owned()
    }
}

/// One text for each value of a finding; a value of one log alone says so.
pub(super) fn values(finding: &Finding) -> Vec<String> {
    let row = |(parameter, log): &(Parameter, Option<&OwnValue>)| match log {
        Some(own) => format!("{} in {}", value(parameter), own.log_name()),
        None => value(parameter),
    };
    finding.rows().iter().map(row).collect()
}

/// `F_c1 = 0.1598 N m (0.1593 to 0.1603)`
fn value(parameter: &Parameter) -> String {
    format!("{} = {}", parameter.name, amount(parameter))
}

/// `0.1598 N m (0.1593 to 0.1603)`
fn amount(parameter: &Parameter) -> String {
    let (value, ends) = digits(parameter);
    let unit = if parameter.unit == "1" {
        String::new()
    } else {
        format!(" {}", parameter.unit)
    };
    let interval = ends.map_or_else(
        || " (not fitted)".to_owned(),
        |[low, high]| format!(" ({low} to {high})"),
    );
    value + &unit + &interval
}

/// A parameter's value and the ends of its interval, in as many digits as they are worth.
pub(crate) fn digits(parameter: &Parameter) -> (String, Option<[String; 2]>) {
    let resolution = match parameter.ci95 {
        Some([low, high]) => 0.05 * (high - low),
        None => 1e-4 * parameter.value.abs(),
    };
    let number = |x: f64| rounded(x, resolution);
    (
        number(parameter.value),
        parameter.ci95.map(|ends| ends.map(number)),
    )
}

/// As many digits as the resolution is worth.
fn rounded(x: f64, resolution: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    let resolution = resolution.max(1e-9 * x.abs()).max(1e-12);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and 12
    let digits = (-resolution.log10()).ceil().clamp(0.0, 12.0) as usize;
    format!("{x:.digits$}")
}

fn probability(p: f64) -> String {
    if p < 1e-12 {
        "< 1e-12".to_owned()
    } else if p < 1e-3 {
        format!("{p:.0e}")
    } else {
        format!("{p:.3}")
    }
}

/// Every model that was scored on the test logs, with its name in a table.
fn scored(outcome: &Outcome) -> Vec<(&str, Summary)> {
    let errors = &outcome.errors;
    let mut models = vec![
        ("declared model as written", &errors.declared),
        ("declared model, fitted", &errors.before),
        ("with effects", &errors.after),
    ];
    let hybrid = errors.hybrid.iter();
    models.extend(hybrid.map(|m| ("with effects and network", m)));
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
        "## Open-loop error on the test logs\n\nRoot mean square of the position error; in brackets the median over windows.{}\n\n\
         | horizon | joint | windows | {} | after / before |\n|---|---|---|{}---|\n",
        if outcome.errors.against.is_empty() {
            ""
        } else {
            " Models after those with effects are other files, scored as they are."
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
                "\n{name}: {diverged} windows diverged; they count with the error they had reached."
            );
        }
    }
    if let Some([low, high]) = outcome.errors.reduction_ci95 {
        let _ = writeln!(
            out,
            "\nThe effects take away {:.0} to {:.0} % of the error at {} s (95 % interval, by resampling stretches of the test logs).",
            100.0 * low,
            100.0 * high,
            before.horizons_s[before.horizons_s.len() / 2]
        );
    }
    out + "\n![predictions](predictions.svg)\n\n![errors](errors.svg)\n\n"
}

/// A position error in rad (or m), three significant digits.
pub(super) fn small(x: f64) -> String {
    rounded(x, 0.01 * x.abs())
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
            "- {}; without the effects {:.5}",
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

/// Why the numbers in the file do not predict these logs, parameter by parameter.
fn contradicted(outcome: &Outcome) -> String {
    if outcome.models.contradicted.is_empty() {
        return String::new();
    }
    let errors = &outcome.errors;
    let (written, fitted) = (errors.declared.position_rms(), errors.before.position_rms());
    let mut out = format!(
        "## Declared values that these logs contradict\n\nWith the values in its file the declared model is off by {} on the test \
         logs at {} s (root mean square over the joints); its equations with the values fitted to the training logs by {}: \
         {:.2} of that. Outside of the fitted 95 % intervals lie:\n\n",
        small(written),
        errors.before.middle().horizon_s,
        small(fitted),
        fitted / written.max(f64::MIN_POSITIVE)
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
    out + "\nmodel.toml holds the fitted values. Where the declared ones come from another log, `residyn audit` says what that \
           log is good for; where they come from a drawing, look for a unit, a gear ratio or a torque constant.\n\n"
}

fn alternatives(outcome: &Outcome) -> String {
    if outcome.effects.alternatives.is_empty() {
        return String::new();
    }
    let mut out = String::from("## Other explanations that these logs do not rule out\n\n");
    for alternative in &outcome.effects.alternatives {
        let _ = writeln!(
            out,
            "- **{}** on joint {}: {}. To tell: {}.",
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
            "The logs leave nothing to confirm the effects on beyond what they were chosen by.\n"
                .into()
        }
        (false, stretches) => format!(
            "Each effect lowers the loss on {stretches} stretches of training data that it was not chosen by.\n"
        ),
    };
    for taken_back in &outcome.effects.taken_back {
        let (label, reason) = (taken_back.effect.label(), &taken_back.reason);
        let _ = writeln!(out, "- **{label}** was chosen and taken back: {reason}.");
    }
    if out.is_empty() { out } else { out + "\n" }
}

fn left(outcome: &Outcome) -> String {
    let left = &outcome.remainder.unexplained;
    let p = probability(left.p_value);
    let share = 100.0 * left.omnibus.most().1;
    let structure = match left.place.as_str() {
        UNKNOWN => format!(
            "The residuals are no noise (p = {p}; {share:.0} % of their variance is more than white noise), and follow \
             no smooth shape over angle, speed, torque or time: think of something with a memory or a rhythm of its \
             own, such as a spring in the joint, presliding or a disturbance."
        ),
        place if left.is_significant() => format!("It follows {place} (p = {p})."),
        _ if left.p_value < SIGNIFICANT => format!(
            "There is structure in it (p = {p}), too little to matter: {share:.1} % of the residuals' variance is more \
             than white noise, and no shape that was probed saves {:.0} % of the loss.",
            100.0 * NOTEWORTHY
        ),
        _ => format!("The residuals are like the sensor's noise (p = {p})."),
    };
    let network = match &outcome.errors.hybrid {
        Some(hybrid) if hybrid.position_rms() > 1.01 * outcome.errors.after.position_rms() => {
            "The residual network raises the error on the test logs: prefer model.toml to the checkpoint.\n"
        }
        _ => "",
    };
    format!(
        "## What is left\n\n{:.1} % of the residual variance above the sensor's noise is left. {structure}\n{network}\
         Residual generalised force: {} before, {} after (root mean square over stretches of 0.15 s, N m or N).\n\n\
         ![residual](residual.svg)\n\n{}",
        100.0 * left.fraction,
        force(&outcome.remainder.before),
        force(&outcome.remainder.after),
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
        "{}.\nNothing but its fit speaks for it. As an effect file, for a folder that `--effects` names:\n\n\
         ```toml\n{}```\n\n",
        capitalised(&proposal_line(proposal)),
        proposal.file
    )
}

/// `proposal, not a finding: force on joint 1 ~ -0.0012 * qd1^3 (explains 81 % of what is left on stretches left out)`
pub(super) fn proposal_line(proposal: &Proposal) -> String {
    format!(
        "proposal, not a finding: force on joint {} ~ {} (explains {:.0} % of what is left on stretches left out)",
        proposal.joint,
        proposal.formula,
        100.0 * proposal.explains
    )
}

fn tried(outcome: &Outcome) -> String {
    let mut out = String::from(
        "## What was tried\n\nGain: fall of the loss on stretches left out of the fit.\n\n",
    );
    for (number, round) in outcome.effects.rounds.iter().enumerate() {
        let _ = writeln!(
            out,
            "Round {} ({} candidates; the most promising ones were fitted):\n\n| effect | joint | gain | p | |\n|---|---|---|---|---|",
            number + 1,
            round.candidates
        );
        for (i, evidence) in round.evidence.iter().enumerate() {
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} | {} |",
                evidence.effect.title(),
                evidence.effect.joint,
                share(evidence.gain),
                probability(evidence.p_value),
                if round.chosen == Some(i) { "added" } else { "" }
            );
        }
        out.push('\n');
    }
    if outcome.effects.rounds.len() == MOST_EFFECTS
        && outcome
            .effects
            .rounds
            .last()
            .is_some_and(|r| r.chosen.is_some())
    {
        let _ = writeln!(
            out,
            "The search ended at its limit of {MOST_EFFECTS} effects; there may be more.\n"
        );
    }
    out
}

fn logs(outcome: &Outcome) -> String {
    let how = match &outcome.given.split {
        SplitMethod::Given => "as given".to_owned(),
        SplitMethod::LastLogs { count } => {
            format!("the last {count} of the logs were kept for the test")
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
