use thiserror::Error;

use super::separation::{Separation, separation};
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::judge::Found;
use crate::closeloop::select::Rival;
use crate::closeloop::stage::{Progress, Stage, Watch};
use crate::model::FittedEffect;

/// Another explanation that the logs do not distinguish from the reported one.
#[derive(Debug, Clone)]
pub struct Alternative {
    /// The complete set of effects.
    pub effects: Vec<FittedEffect>,
    /// The effect that the reported set does not have.
    pub effect: FittedEffect,
    pub reason: String,
    /// The experiment that would distinguish it from the reported explanation, or why none was simulated.
    pub separation: Result<Separation, NotSimulated>,
}

/// Why no experiment was simulated against an alternative.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum NotSimulated {
    #[error("not simulated: other alternatives rank higher")]
    Rank,
    #[error("not simulated: a model diverges on the logged motion")]
    Diverged,
    #[error("not simulated: torques were compared, and the controller dictates the motion")]
    Torques,
}

/// The sets of effects that explain the logs as well as the confirmed set, best first; sets that replace a withdrawn
/// effect are left out. For the best sets, the experiment that distinguishes the two explanations is simulated.
pub fn discriminate(found: &Found<'_>, watch: &dyn Watch) -> Vec<Alternative> {
    let (problem, fitted) = (&found.problem, &found.chosen.after);
    let stands = |effect: &FittedEffect| {
        let mut effects = fitted.model.effects.iter();
        effects.any(|other| other.is_same(effect))
    };
    let mut rivals: Vec<&Rival> = (found.chosen.rivals.iter())
        .filter(|rival| stands(&rival.instead_of))
        .collect();
    rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let alternative = |(rank, rival): (usize, &Rival)| {
        if problem.error_model == ErrorModel::InverseDynamics {
            return Alternative::of(rival, Err(NotSimulated::Torques));
        }
        if rank >= problem.settings.discriminate.alternatives {
            return Alternative::of(rival, Err(NotSimulated::Rank));
        }
        let text = format!("simulating experiments against {}", rival.effect.label());
        watch.see(Progress::within(Stage::Discriminate, &text));
        let separation = separation(problem, fitted, rival).ok_or(NotSimulated::Diverged);
        Alternative::of(rival, separation)
    };
    rivals.into_iter().enumerate().map(alternative).collect()
}

impl Alternative {
    fn of(rival: &Rival, separation: Result<Separation, NotSimulated>) -> Self {
        let chosen = rival.instead_of.label();
        let reason = if rival.contains_chosen() {
            format!("contains {chosen} and explains these logs no better")
        } else {
            format!(
                "not separable from {chosen} on these logs: together with the other effects it cuts the left-out loss \
                 by {:.1} %, {chosen} by {:.1} %",
                100.0 * rival.gain,
                100.0 * rival.gain_of_chosen
            )
        };
        Self {
            effects: rival.fitted.model.effects.clone(),
            effect: rival.effect.clone(),
            reason,
            separation,
        }
    }

    /// The experiment, in a sentence.
    pub fn experiment(&self) -> String {
        match &self.separation {
            Ok(separation) => separation.text(),
            Err(reason) => reason.to_string(),
        }
    }
}
