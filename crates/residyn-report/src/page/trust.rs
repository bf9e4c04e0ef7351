//! Whether the answer can be trusted: what else explains the logs, what they leave open, and what is wrong with them.

use maud::{Markup, html};

use super::calibration::calibration;
use super::logs::by_log;
use super::missing::value;
use super::{Section, table};
use crate::bodies::{poor, sum};
use crate::diagnostics::{network, structure};
use crate::schema::{FitEntry, Report};
use crate::wording::{FITTED, WITH_EFFECTS, amount, small};
use residyn_core::data::{Finding, Severity};
use residyn_core::digits::amount_of;

pub(super) fn section(report: &Report) -> Section {
    Section {
        id: "trust",
        question: "Can I trust it?",
        answer: html! {
            (left(report))
            (alternatives(report))
            @if let Some(found) = &report.calibration { (calibration(found)) }
            (parameters(report))
            (by_log(report))
            (contradicted(report))
            (fits(report))
            (findings(report))
        },
    }
}

fn left(report: &Report) -> Markup {
    html! {
        h3 { "What is left" }
        p { (structure(report)) " " (network(report)) }
        @if let Some(proposal) = &report.unexplained.proposal {
            details {
                summary { "A proposal, not a finding, for joint " (proposal.joint) }
                p { "Force " code { (proposal.formula) } " removes " (format!("{:.0} %", 100.0 * proposal.explains))
                    " of the residual on blocks left out of its fit. As an effect file:" }
                pre tabindex="0" { (proposal.file) }
            }
        }
    }
}

fn alternatives(report: &Report) -> Markup {
    html! {
        h3 { "Other explanations" }
        @if report.alternatives.is_empty() { p { "None of the effects tried explains the logs as well." } }
        ul { @for rival in &report.alternatives { li { strong { (rival.title) } " on joint " (rival.place) ": " (rival.reason) "." } } }
    }
}

fn parameters(report: &Report) -> Markup {
    let known = &report.identifiability;
    let heads = [
        "parameter",
        "declared",
        "fitted without the effects",
        "final",
        "identifiable",
    ];
    let rows = html! {
        @for one in &report.parameters {
            tr.doubtful[!one.fitted.identifiable] {
                th scope="row" { code { (one.fitted.name) } }
                td { (small(one.declared)) }
                td { (small(one.before)) }
                td { (amount(&one.fitted)) }
                td { @if one.fitted.identifiable { "yes" } @else { "no" } }
            }
        }
    };
    html! {
        h3 { "Parameters" }
        p { "The logs determine " (known.determined) " of " (known.free) " free parameters of the declared equations." }
        details open[report.parameters.len() <= MOST_SHOWN] {
            summary { "Values with their 95 % intervals" }
            (table(heads, &rows))
        }
        (bodies(report))
    }
}

/// The sums of the bodies' parameters that torques determine.
fn bodies(report: &Report) -> Markup {
    let known = &report.identifiability;
    let rows = html! {
        @for one in &known.bodies {
            tr {
                th scope="row" { (one.body) }
                td { code { (sum(one)) } }
                td { (small(one.declared)) }
                td { (amount_of(one.value, Some(one.ci95), &one.unit)) }
            }
        }
    };
    html! {
        @if known.identifiable_at_most > 0 {
            details {
                summary { "Bodies: these logs determine " (known.bodies.len()) " of the " (known.identifiable_at_most) " sums of parameters that any motion could determine" }
                p { (poor(known.bodies.len(), known.identifiable_at_most)) }
                (table(["body", "sum", "declared", "fitted"], &rows))
            }
        }
    }
}

/// More parameters than this are folded away.
const MOST_SHOWN: usize = 12;

fn contradicted(report: &Report) -> Markup {
    html! {
        @if !report.contradicted.is_empty() {
            h3 { "Declared values that these logs contradict" }
            ul { @for one in &report.contradicted { li { (value(&one.fitted)) "; declared " (small(one.declared)) ": " (one.comparison) } } }
        }
    }
}

fn fits(report: &Report) -> Markup {
    let fit = |name: &str, fit: &FitEntry| {
        html! { li { (name) ": " (fit.termination) " (" (fit.steps) " steps)" @if !fit.converged { strong { ", not converged" } } } }
    };
    html! {
        h3 { "Fits" }
        ul { (fit(FITTED, &report.fits.before)) (fit(WITH_EFFECTS, &report.fits.after)) }
        @if report.stopped { p { "The search was stopped when its time ran out." } }
    }
}

fn findings(report: &Report) -> Markup {
    let warnings = warnings(report);
    html! {
        h3 { "The logs" }
        @if warnings.is_empty() { p { "The audit found nothing to warn about." } }
        @for (log, findings) in warnings {
            details {
                summary { (log) ": " (findings.len()) @if findings.len() == 1 { " finding" } @else { " findings" } }
                ul { @for finding in findings { li { (finding.to_string()) } } }
            }
        }
    }
}

/// What the audit found in each log, except for remarks; logs without findings are left out.
fn warnings(report: &Report) -> Vec<(&str, Vec<&Finding>)> {
    let matters = |finding: &&Finding| finding.severity != Severity::Info;
    let of_log = report.audit.iter().map(|audit| {
        let findings = audit.findings.iter().filter(matters).collect();
        (audit.log.as_str(), findings)
    });
    of_log
        .filter(|(_, findings): &(&str, Vec<_>)| !findings.is_empty())
        .collect()
}
