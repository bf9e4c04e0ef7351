//! What is missing: the effects, with the equations that they join.

use maud::{Markup, html};

use super::Section;
use super::maths::formula;
use crate::schema::{EffectEntry, ParameterEntry, Report};
use crate::text::removed;
use crate::wording::{amount, p_value};
use residyn_core::closeloop::ErrorModel;

pub(super) fn section(report: &Report) -> Section {
    Section {
        id: "missing",
        question: "What is missing?",
        answer: html! {
            @if report.effects.is_empty() { p { (report.headline) "." } }
            div.cards { @for effect in &report.effects { (card(report, effect)) } }
            (supported(report))
            (equations(report))
        },
    }
}

fn card(report: &Report, effect: &EffectEntry) -> Markup {
    let error = match report.compared {
        ErrorModel::OutputError => "position error",
        ErrorModel::InverseDynamics => "torque error",
    };
    html! {
        article.card {
            h3 { (effect.title) " on joint " (effect.place) }
            (added(effect))
            p.small { (effect.enters) }
            ul { @for parameter in &effect.parameters { li { (value(parameter)) } } }
            p.small {
                (p_value(effect.p_value)) ". "
                "Share of the " (error) " on the test logs that it removes: " (removed(effect)) "."
            }
        }
    }
}

fn added(effect: &EffectEntry) -> Markup {
    html! {
        @match &effect.latex {
            Some(latex) => (formula(latex)),
            None => p { code { (effect.expression) } },
        }
    }
}

/// `F_c1 = 0.1598 N m (0.1593 to 0.1603)`
pub(super) fn value(parameter: &ParameterEntry) -> Markup {
    html! { code { (parameter.name) } " = " (amount(parameter)) }
}

fn supported(report: &Report) -> Markup {
    html! {
        @if !report.supported.is_empty() {
            details {
                summary { "Supported, not established: " (report.supported.len()) }
                p { "These lower the loss on blocks left out of the fit and are in the model, but do not rely on their names." }
                ul {
                    @for effect in &report.supported {
                        li {
                            strong { (effect.title) } " on joint " (effect.place) ": "
                            @for (k, parameter) in effect.parameters.iter().enumerate() { @if k > 0 { ", " } (value(parameter)) }
                            @if let Some(reason) = &effect.not_established { " \u{2013} " (reason) "." }
                        }
                    }
                }
            }
        }
    }
}

/// The declared equations, then what was added, marked.
fn equations(report: &Report) -> Markup {
    html! {
        h3 { "The equations" }
        @for line in &report.equations { (formula(line)) }
        @for effect in report.effects.iter().filter(|effect| effect.latex.is_some()) {
            div.new { span.small { "new, " (effect.enters) ": " (effect.title) " on joint " (effect.place) } (added(effect)) }
        }
    }
}
