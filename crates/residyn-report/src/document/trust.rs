//! Whether the answer can be trusted: what else explains the logs, what they leave open, and what is wrong with them.

use super::bodies::bodies;
use super::calibration::calibration;
use super::left::left;
use super::logs::by_log;
use super::tried::tried;
use super::{Block, Cell, better, cell, folded, folded_if_large, heading, paragraph, table};
use crate::schema::{
    AlternativeEntry, AuditEntry, ContradictedEntry, FitEntry, IdentifiabilityEntry, RefittedEntry,
    Report,
};
use crate::wording::{FITTED, WITH_EFFECTS, amount, listed, small};
use residyn_core::data::{Finding, Severity, Together, together};

pub(super) fn answer(report: &Report) -> Vec<Block> {
    let calibration = report.calibration.as_ref().map(calibration);
    let parts = [
        left(report),
        alternatives(report),
        vec![tried(report)],
        calibration.unwrap_or_default(),
        parameters(report),
        by_log(report),
        contradicted(report),
        fits(report),
        findings(report),
    ];
    parts.concat()
}

fn alternatives(report: &Report) -> Vec<Block> {
    let item = |rival: &AlternativeEntry| {
        format!(
            "**{}** on joint {}: {}.",
            rival.title, rival.place, rival.reason
        )
    };
    let rivals = match report.alternatives.is_empty() {
        true => paragraph("None of the effects tried explains the logs as well."),
        false => Block::List(report.alternatives.iter().map(item).collect()),
    };
    let about = format!(
        "Effects that explain as much: {}",
        report.alternatives.len()
    );
    let rivals = folded_if_large(report, &about, vec![rivals]);
    [vec![heading("Other explanations")], rivals].concat()
}

/// More parameters than this are folded away.
const MOST_SHOWN: usize = 12;

fn parameters(report: &Report) -> Vec<Block> {
    let known = &report.identifiability;
    let about = format!(
        "The logs determine {} of {} free parameters of the declared equations.",
        known.determined, known.free
    );
    let heads = [
        "parameter",
        "declared",
        "fitted without the effects",
        "final",
        "identifiable",
    ];
    let values = Block::Folded {
        about: "Values with their 95 % intervals".to_owned(),
        is_open: report.parameters.len() <= MOST_SHOWN,
        blocks: vec![table(1, heads, report.parameters.iter().map(parameter))],
    };
    let held = known.held.iter();
    let held = held.map(|name| format!("`{name}` is held: {}", why_held(known, name)));
    let held = (!known.held.is_empty()).then(|| {
        let about = format!("Held at their declared values: {}", known.held.len());
        folded_if_large(report, &about, vec![Block::List(held.collect())])
    });
    let blocks = [heading("Parameters"), paragraph(about), values];
    (blocks.into_iter().chain(held.into_iter().flatten()))
        .chain(bodies(report))
        .collect()
}

fn parameter(one: &RefittedEntry) -> Vec<Cell> {
    let is_known = one.fitted.identifiable;
    let texts = [
        format!("`{}`", one.fitted.name),
        small(one.declared),
        small(one.before),
        amount(&one.fitted),
        if is_known { "yes" } else { "no" }.to_owned(),
    ];
    let look = |text| Cell {
        class: (!is_known).then_some("doubtful"),
        ..cell(text)
    };
    texts.into_iter().map(look).collect()
}

/// More parameters than this that trade off against one another are counted, not named.
const MOST_NAMED: usize = 6;

/// What the logs leave open about a parameter.
fn why_held(verdict: &IdentifiabilityEntry, name: &str) -> String {
    let weight = |direction: &&Vec<(String, f64)>| {
        let own = direction.iter().find(|(other, _)| other == name);
        own.map_or(0.0, |(_, weight)| weight.abs())
    };
    let directions = verdict.undetermined.iter();
    let direction = directions.max_by(|a, b| weight(a).total_cmp(&weight(b)));
    let others: Vec<String> = (direction.into_iter().flatten())
        .filter(|(other, _)| other != name)
        .map(|(other, _)| format!("`{other}`"))
        .collect();
    let with = match others.len() {
        0 => return "the logs do not determine it, so it stays at its declared value.".to_owned(),
        1..=MOST_NAMED => listed(&others),
        _ => format!("{} others", others.len()),
    };
    format!(
        "it trades off against {with}, and the logs determine only their combination. It stays as close to its \
         declared value as they allow; intervals of the others, and of effects, are conditional on it."
    )
}

/// The values in the model file that do not hold for these logs.
fn contradicted(report: &Report) -> Vec<Block> {
    if report.contradicted.is_empty() {
        return Vec::new();
    }
    let error = &report.error;
    let (middle, horizon_s) = error.middle();
    let [written, fitted] = [&error.declared, &error.before].map(|model| model.of_all(middle));
    let about = format!(
        "On the test logs, {horizon_s} s ahead, the position error of the declared model is {} {unit} with the values in its file \
         and {} {unit} with its parameters fitted to the training logs. These declared values lie outside the 95 % intervals of \
         the final fit, which includes the effects found:",
        small(written),
        small(fitted),
        unit = better::position_unit(report),
    );
    let item = |one: &ContradictedEntry| {
        format!(
            "`{}`: declared {}, fitted {}: {}",
            one.fitted.name,
            one.declared,
            amount(&one.fitted),
            one.comparison
        )
    };
    let advice = "`model.toml` holds the fitted values. If a declared value comes from another log, check that log with `residyn \
                  audit`; if it comes from a drawing, look for a wrong unit, gear ratio or torque constant.";
    vec![
        heading("Declared values that these logs contradict"),
        paragraph(about),
        Block::List(report.contradicted.iter().map(item).collect()),
        paragraph(advice),
    ]
}

fn fits(report: &Report) -> Vec<Block> {
    let fits = &report.fits;
    let ends = [(FITTED, &fits.before), (WITH_EFFECTS, &fits.after)];
    let moved: Vec<String> = (fits.moved_to.iter())
        .map(|(name, value)| format!("`{name}` = {value:.3}"))
        .collect();
    let moved = (!moved.is_empty()).then(|| {
        format!(
            "With the values in its file the model diverges on these logs: the fit began at {}.",
            listed(&moved)
        )
    });
    let items = ends.into_iter().map(|(name, fit)| ended(name, fit));
    let list = Block::List(items.chain(moved).collect());
    let stopped =
        (report.stopped).then(|| paragraph("The search was stopped when its time ran out."));
    let blocks = [heading("Fits"), list];
    blocks.into_iter().chain(stopped).collect()
}

fn ended(name: &str, fit: &FitEntry) -> String {
    let [as_is, scaled] = fit.condition.map(|number| number.unwrap_or(f64::INFINITY));
    let unfinished = match fit.converged {
        true => "",
        false => ", **not converged**",
    };
    format!(
        "{name}: {} ({} steps; condition number {as_is:.1e}, {scaled:.1e} after scaling){unfinished}",
        fit.termination, fit.steps
    )
}

/// What the audit found, except for remarks: in several logs alike, then in each; logs without findings are left out.
fn findings(report: &Report) -> Vec<Block> {
    let of_log = |audit: &AuditEntry| {
        let matters = |finding: &&Finding| finding.severity != Severity::Info;
        let findings = audit.findings.iter().filter(matters);
        let log = audit.log.clone();
        let said = findings.map(|finding| (log.clone(), finding.to_string()));
        said.collect::<Vec<_>>()
    };
    let said = together(report.audit.iter().flat_map(of_log));
    let (shared, own): (Vec<Together>, Vec<Together>) =
        said.into_iter().partition(|one| one.logs.len() > 1);
    let about = |one: Together| format!("{}: {}", one.about(report.audit.len()), one.text);
    let shared = listed_findings("several logs", shared.into_iter().map(about).collect());
    let of_log = |audit: &AuditEntry| {
        let own = own.iter().filter(|one| one.logs[0] == audit.log);
        listed_findings(&audit.log, own.map(|one| one.text.clone()).collect())
    };
    let each = report.audit.iter().filter_map(of_log);
    let mut found: Vec<Block> = shared.into_iter().chain(each).collect();
    if found.is_empty() {
        found.push(paragraph("The audit found nothing to warn about."));
    }
    [vec![heading("The logs")], found].concat()
}

/// What was found in `place`, if anything was.
fn listed_findings(place: &str, findings: Vec<String>) -> Option<Block> {
    let plural = if findings.len() == 1 { "" } else { "s" };
    let about = format!("{place}: {} finding{plural}", findings.len());
    (!findings.is_empty()).then(|| folded(about, vec![Block::List(findings)]))
}
