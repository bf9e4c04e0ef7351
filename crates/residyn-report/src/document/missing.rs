//! What is missing: the effects, with the equations that they join.

use super::Block::{self, Boxed, Formula, List, Small};
use super::{folded, heading, paragraph, value, values};
use crate::schema::{EffectEntry, Report};
use crate::wording::{p_value, reduction};
use residyn_core::closeloop::ErrorModel;

pub(super) fn answer(report: &Report) -> Vec<Block> {
    let cards = report.effects.iter().map(|effect| card(report, effect));
    let found = match report.effects.is_empty() {
        true => paragraph(format!("{}.", report.headline)),
        false => Boxed("cards", cards.collect()),
    };
    let known = [found].into_iter().chain(supported(report));
    let title = [heading("The equations")];
    known.chain(title).chain(equations(report)).collect()
}

pub(super) fn card(report: &Report, effect: &EffectEntry) -> Block {
    let evidence = format!(
        "{}. Share of the {}, compared with a refit without it: {}.",
        p_value(effect.p_value),
        error(report, effect),
        removed(effect)
    );
    let card = vec![
        Block::Heading(effect.named()),
        added(effect),
        Small(effect.enters.clone()),
        List(effect.parameters.iter().map(value).collect()),
        Small(evidence),
    ];
    Boxed("card", card)
}

fn added(effect: &EffectEntry) -> Block {
    match &effect.latex {
        Some(latex) => Formula {
            latex: latex.clone(),
            plain: Some(effect.expression.clone()),
        },
        None => paragraph(format!("`{}`", effect.expression)),
    }
}

/// The error that shows an effect.
fn error(report: &Report, effect: &EffectEntry) -> &'static str {
    match report.compared {
        _ if effect.motion_reduction.is_some() => {
            "squared error of the motion under the commands that it removes on the training logs"
        }
        ErrorModel::OutputError => {
            "position error on the test logs, at the middle horizon, that it removes"
        }
        ErrorModel::InverseDynamics => "torque error on the test logs that it removes",
    }
}

/// The share of that error which an effect removes.
fn removed(effect: &EffectEntry) -> String {
    let share = effect.motion_reduction.or(effect.error_reduction);
    match (share, &effect.error_reduction_failure) {
        (Some(part), _) => reduction(part, "error"),
        (None, failure) => format!(
            "not computed (refit without it: {})",
            failure.as_deref().unwrap_or_default()
        ),
    }
}

fn supported(report: &Report) -> Option<Block> {
    let effects = &report.supported;
    (!effects.is_empty()).then(|| {
        let about = "These lower the loss on blocks left out of the fit and are in the model, but do not rely on their names.";
        folded(
            format!("Supported, not established: {}", effects.len()),
            vec![paragraph(about), List(effects.iter().map(supported_item).collect())],
        )
    })
}

pub(super) fn supported_item(effect: &EffectEntry) -> String {
    format!(
        "**{}** on joint {}, {}: {}.",
        effect.title,
        effect.place,
        values(&effect.parameters),
        effect.not_established.as_deref().unwrap_or_default()
    )
}

/// The declared equations, then what was added, marked.
pub(super) fn equations(report: &Report) -> Vec<Block> {
    let declared = report.equations.iter().map(|line| Formula {
        // A row of an `align` environment on its own.
        latex: line.replace("&=", "="),
        plain: None,
    });
    let with_formula = report.effects.iter().filter(|e| e.latex.is_some());
    let new = with_formula.map(|effect| {
        let about = format!("new, {}: {}", effect.enters, effect.named());
        Boxed("new", vec![Small(about), added(effect)])
    });
    declared.chain(new).collect()
}
