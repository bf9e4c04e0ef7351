//! The answer in one sentence, and the names of joints as people use them.

use std::cmp::Reverse;
use std::collections::BTreeSet;

use super::overview::is_large;
use super::wording::listed;
use residyn_core::closeloop::{Outcome, Verdict};
use residyn_core::data::Joint;
use residyn_core::model::FittedEffect;

pub(super) fn headline(outcome: &Outcome) -> String {
    let mut titles: Vec<String> = Vec::new();
    let mut on: Vec<Vec<&FittedEffect>> = Vec::new();
    for finding in &outcome.effects.findings {
        let title = finding.effect.title();
        match titles.iter().position(|known| *known == title) {
            Some(known) => on[known].push(&finding.effect),
            None => {
                titles.push(title);
                on.push(vec![&finding.effect]);
            }
        }
    }
    let found = titles.into_iter().zip(on).collect();
    let found = match is_large(outcome.models.after.model.joints) {
        true => counted(found),
        false => named(outcome, found),
    };
    let is_fitted = outcome.models.after.fit.termination.has_converged();
    match (outcome.verdict, found.is_empty()) {
        (Verdict::Inconclusive, _) if !is_fitted => "No verdict: the final fit failed".to_owned(),
        (Verdict::Inconclusive, _) => "The logs do not allow a verdict".to_owned(),
        (_, false) => format!("The model lacks {}", listed(&found)),
        (Verdict::Unexplained, true) => {
            "Something is missing that no known effect explains".to_owned()
        }
        (_, true) => "These logs show no missing effect".to_owned(),
    }
}

/// Effects of one name, on their joints.
type Alike<'o> = (String, Vec<&'o FittedEffect>);

/// Each with the names of its joints.
fn named(outcome: &Outcome, found: Vec<Alike<'_>>) -> Vec<String> {
    let named = found.into_iter().map(|(title, effects)| {
        let plural = if effects.len() > 1 { "s" } else { "" };
        let joints: Vec<String> = effects
            .iter()
            .map(|effect| place(outcome, effect))
            .collect();
        format!("{title} on joint{plural} {}", listed(&joints))
    });
    named.collect()
}

/// Each with the number of its joints, the most frequent first: `coulomb_friction on 11 joints`, `actuator_delay on 5`.
fn counted(found: Vec<Alike<'_>>) -> Vec<String> {
    let joints = |effects: &[&FittedEffect]| {
        let joints = effects.iter().flat_map(|effect| effect.joints());
        joints.collect::<BTreeSet<Joint>>().len()
    };
    let mut counted: Vec<(String, usize)> = found
        .into_iter()
        .map(|(title, effects)| (title, joints(&effects)))
        .collect();
    counted.sort_by_key(|(_, count)| Reverse(*count));
    let counted = counted.into_iter().enumerate();
    counted
        .map(|(k, (title, count))| match (k, count) {
            (0, 1) => format!("{title} on 1 joint"),
            (0, _) => format!("{title} on {count} joints"),
            _ => format!("{title} on {count}"),
        })
        .collect()
}

/// A joint for people.
pub(super) fn label(outcome: &Outcome, joint: Joint) -> String {
    outcome.models.after.model.joint_label(joint)
}

/// The joint of an effect, or both joints if it couples two.
pub(super) fn place(outcome: &Outcome, effect: &FittedEffect) -> String {
    effect.place(|joint| label(outcome, joint))
}
