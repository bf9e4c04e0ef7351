//! The answer in one sentence, and the names of joints as people use them.

use super::wording::listed;
use residyn_core::closeloop::{Outcome, Verdict};
use residyn_core::data::Joint;
use residyn_core::model::FittedEffect;

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
            format!("{title} on joint{plural} {}", listed(joints))
        })
        .collect();
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

/// A joint for people.
pub(super) fn label(outcome: &Outcome, joint: Joint) -> String {
    outcome.models.after.model.joint_label(joint)
}

/// The joint of an effect, or both joints if it couples two.
pub(super) fn place(outcome: &Outcome, effect: &FittedEffect) -> String {
    effect.place(|joint| label(outcome, joint))
}
